# SPDX-License-Identifier: Apache-2.0
"""The page that `raysplats view` shows, from Python."""

from __future__ import annotations

import weakref
import webbrowser
from collections.abc import Sequence

from ._raysplats import Camera, Context, Model, TraceOptions, _ModelViewer


class Viewer:
    """Shows a model in a browser while the program goes on: a thread draws it, taking turns with
    what else uses the context, and what `Model.assign()` changes is seen at once.

    `options` are those that the model looks right with, `cameras` the page's list, the first of
    them where it begins. With port 0 any that is free is taken; `url` has it, and whoever has the
    url may look, from other machines too unless `host` is 127.0.0.1. `origin` is that of the model
    (`Dataset.origin`): camera paths of the page are in the coordinates of the data set's files, as
    `raysplats render --path` takes them. `open` opens a browser. It ends with close(), at the end
    of a `with` block, or with the program. Pillow draws its pictures into files, or whatever
    set_image_functions() was given."""

    def __init__(
        self,
        context: Context,
        model: Model,
        options: TraceOptions | None = None,
        cameras: Sequence[Camera] = (),
        *,
        name: str = "model",
        host: str = "127.0.0.1",
        port: int = 0,
        max_size: int = 1920,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        open: bool = True,
    ) -> None:
        if options is None:
            options = TraceOptions()
        self._viewer = _ModelViewer(
            context, model, options, list(cameras), name, host, port, max_size, list(origin)
        )
        self._end = weakref.finalize(self, self._viewer.close)
        if open:
            webbrowser.open(self.url)

    @property
    def url(self) -> str:
        """The address to open."""
        return self._viewer.url

    def wait(self) -> None:
        """Returns when it is closed; Ctrl-C raises KeyboardInterrupt."""
        self._viewer.wait()

    def close(self) -> None:
        """Ends it; a second time does nothing, and neither does it in a child by fork."""
        self._end()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<raysplats.Viewer: {self.url}>"
