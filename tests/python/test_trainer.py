# SPDX-License-Identifier: Apache-2.0
import signal
import subprocess
import sys
import textwrap
import threading

import numpy as np
import pytest

import photos
import raysplats as rs

pytest.importorskip("PIL")


@pytest.fixture(scope="module")
def folder(context, tmp_path_factory):
    return photos.take(context, tmp_path_factory.mktemp("ring") / "photos")


def options(iterations):
    return rs.TrainOptions(
        iterations=iterations, init_count=200, sh_degree=0, densify_until=0, resolution_schedule=[]
    )


def test_dataset(folder, tmp_path):
    dataset = rs.Dataset.load(folder)
    assert dataset.kind == "nerfstudio" and len(dataset) == 16
    test = dataset.indices("test")
    assert test == [i for i, view in enumerate(dataset.views) if view.test] and len(test) == 2
    view = dataset.views[test[0]]
    assert view.picture().shape == (40, 48, 4) and view.camera.width == 48
    names = [dataset.views[i].camera.name for i in (1, 4)]
    listed = rs.Dataset.load(folder, test_list=names)
    assert [listed.views[i].camera.name for i in listed.indices("test")] == names and listed.test_every == 0
    (tmp_path / "list.txt").write_text("\n".join(names))
    assert rs.Dataset.load(folder, test_list=tmp_path / "list.txt").indices("test") == listed.indices("test")
    with pytest.raises(rs.UsageError, match="1 of 1 names"):
        rs.Dataset.load(folder, test_list=["none.png"])
    with pytest.raises(rs.UsageError, match="split is 'train', 'test' or 'all'"):
        dataset.indices("val")


def test_steps_evaluations_and_going_on(context, folder, tmp_path):
    dataset = rs.Dataset.load(folder)
    trainer = rs.Trainer(context, dataset, tmp_path / "run", options(60))
    heard = []
    assert trainer.step(1, on_step=lambda progress: heard.append(progress.iteration))
    first = trainer.evaluate().psnr
    assert trainer.step(39, on_step=lambda progress: heard.append(progress.iteration))
    assert heard == list(range(1, 41)) and trainer.iteration == 40
    assert trainer.evaluate().psnr > first + 2 and trainer.loss().total > 0
    trainer.save()
    kept = trainer.gaussians()
    assert len(kept) == 200
    del trainer

    again = rs.Trainer(context, dataset, tmp_path / "run", options(60))
    again.resume()
    assert again.iteration == 40 and np.array_equal(again.gaussians().means, kept.means)
    summary = again.run()
    assert summary.iterations == 60 and summary.evaluations[-1].psnr > first + 2
    model = rs.Gaussians.load(tmp_path / "run/point_cloud/iteration_60/point_cloud.ply")
    tracer = rs.Tracer(context, rs.TraceOptions.load(
        tmp_path / "run/point_cloud/iteration_60/point_cloud.ply"))
    on_device = rs.Model(context, model)
    report = rs.evaluate(
        lambda camera: tracer.render(on_device, camera).rgba, dataset,
        background=tracer.options.background, output=tmp_path / "eval",
    )
    assert abs(report.mean.psnr - summary.evaluations[-1].psnr) < 0.02
    assert len(report.images) == 2 and (tmp_path / "eval/metrics.json").exists()


def test_what_a_callback_raises_comes_out(context, folder, tmp_path):
    trainer = rs.Trainer(context, rs.Dataset.load(folder), tmp_path / "run", options(30))

    def stop_at_three(progress):
        if progress.iteration == 3:
            raise LookupError("three")

    with pytest.raises(LookupError, match="three"):
        trainer.step(10, on_step=stop_at_three)
    assert trainer.iteration == 3
    assert trainer.step(1)

    with pytest.raises(rs.UsageError):
        trainer.step(0)


def test_a_refused_call_leaves_the_one_under_way_its_callback(context, folder, tmp_path):
    trainer = rs.Trainer(context, rs.Dataset.load(folder), tmp_path / "run", options(30))
    heard = []

    def refused():
        for call in (trainer.step, trainer.run):
            with pytest.raises(rs.UsageError, match="is training already"):
                call(on_step=lambda progress: heard.append(None))

    def on_step(progress):
        heard.append(progress.iteration)
        if progress.iteration == 2:
            refused()
        if progress.iteration == 4:
            # From another thread, which an iteration does not wait for but this callback does.
            other = threading.Thread(target=refused)
            other.start()
            other.join()
        if progress.iteration == 6:
            trainer.stop()

    assert trainer.step(20, on_step=on_step)
    assert heard == [1, 2, 3, 4, 5, 6] and trainer.iteration == 6
    assert trainer.step(1)


def test_what_a_render_raises_comes_out(folder):
    def broken(camera):
        raise LookupError(camera.name)

    with pytest.raises(LookupError, match="view_"):
        rs.evaluate(broken, rs.Dataset.load(folder))


def test_options():
    given = rs.TrainOptions(iterations=7, eval_at=[1, 5], background=(0.5, 0, 1), masks="cutout")
    assert given.text("iterations") == "7" and given.text("masks") == '"cutout"'
    assert given.text("background") == '"0.5,0,1"'
    given["ssim-weight"] = 0.5
    assert "ssim-weight = 0.5" in given.to_toml()
    for true in (True, np.bool_(True), np.array(True), "true"):
        assert rs.TrainOptions(exposure=true).text("exposure") == "true"
    with pytest.raises(rs.UsageError):
        rs.TrainOptions(exposure="True")
    numbers = rs.TrainOptions(iterations=np.int64(9), ssim_weight=np.float64(0.25), exposure=np.bool_(False))
    assert [numbers.text(key) for key in ("iterations", "ssim-weight", "exposure")] == ["9", "0.25", "false"]
    assert {"iterations", "position-lr"} <= {*rs.TrainOptions.keys()}
    with pytest.raises(rs.UsageError, match="did you mean 'iterations'"):
        rs.TrainOptions(iteration=7)
    with pytest.raises(rs.UsageError, match="'sh-degree' needs a whole number from 0 to 4"):
        rs.TrainOptions(sh_degree=7)


@pytest.mark.parametrize("end", ["", "raise SystemExit(0)", "del trainer"])
def test_the_program_ends_while_photos_are_read(folder, tmp_path, end):
    program = f"""
        import time
        import raysplats as rs
        from raysplats import _images
        def read(*source):
            time.sleep(0.2)
            return _images.read(*source)
        rs.set_image_functions(read, _images.encode)
        options = rs.TrainOptions(
            iterations=100, init="random", init_count=200, sh_degree=0, densify_until=0, resolution_schedule=[],
            image_budget=1)
        trainer = rs.Trainer(rs.Context(), rs.Dataset.load({str(folder)!r}), {str(tmp_path / "run")!r}, options)
        trainer.step(2)
        {end}
    """
    run = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(program)], capture_output=True, text=True, timeout=300)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


@pytest.mark.parametrize("call", ["run(on_step=begun)", "step(100000, on_step=begun)"])
def test_ctrl_c(folder, tmp_path, call):
    program = f"""
        import raysplats as rs
        options = rs.TrainOptions(
            iterations=100000, init_count=200, sh_degree=0, densify_until=0, resolution_schedule=[])
        trainer = rs.Trainer(
            rs.Context(), rs.Dataset.load({str(folder)!r}), {str(tmp_path / "run")!r}, options)
        def begun(progress):
            if progress.iteration == 2:
                print("begun", flush=True)
        try:
            trainer.{call}
        except KeyboardInterrupt:
            print("interrupted at", trainer.iteration, flush=True)
    """
    with subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "begun\n"
        process.send_signal(signal.SIGINT)
        said = process.stdout.read()
    assert process.returncode == 0 and said.startswith("interrupted at ")
    assert 2 <= int(said.split()[-1]) < 100000
    if call.startswith("run"):
        assert list((tmp_path / "run" / "checkpoints").iterdir())
