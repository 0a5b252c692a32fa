// SPDX-License-Identifier: Apache-2.0
// Writes the layout of every shared record as this device's compiler sees it: per record its size,
// then the offset of each field in order of declaration. Launch: one work-item; returns how many
// words it wrote in layout[0].
#include "shared/layout.h"

#define RS_PUT(value) layout[next++] = (uint)(value)
#define RS_FIELD(type, field) RS_PUT(__builtin_offsetof(type, field))

__kernel void layout_probe(__global uint* layout) {
  uint next = 1;
  RS_PUT(sizeof(RsAabb));
  RS_FIELD(RsAabb, lo);
  RS_FIELD(RsAabb, hi);

  RS_PUT(sizeof(RsLine));
  RS_FIELD(RsLine, v);

  RS_PUT(sizeof(RsViewBounds));
  RS_FIELD(RsViewBounds, x0);
  RS_FIELD(RsViewBounds, y0);
  RS_FIELD(RsViewBounds, x1);
  RS_FIELD(RsViewBounds, y1);
  RS_FIELD(RsViewBounds, depth);
  RS_FIELD(RsViewBounds, quantile);
  RS_FIELD(RsViewBounds, kind);
  RS_FIELD(RsViewBounds, padding);

  RS_PUT(sizeof(RsCamera));
  RS_FIELD(RsCamera, rotation);
  RS_FIELD(RsCamera, center);
  RS_FIELD(RsCamera, fx);
  RS_FIELD(RsCamera, fy);
  RS_FIELD(RsCamera, cx);
  RS_FIELD(RsCamera, cy);
  RS_FIELD(RsCamera, width);
  RS_FIELD(RsCamera, height);
  RS_FIELD(RsCamera, near_depth);
  RS_FIELD(RsCamera, padding);

  RS_PUT(sizeof(RsFootprintView));
  RS_FIELD(RsFootprintView, rotation);
  RS_FIELD(RsFootprintView, center);
  RS_FIELD(RsFootprintView, low);
  RS_FIELD(RsFootprintView, high);
  RS_FIELD(RsFootprintView, spacing);
  RS_FIELD(RsFootprintView, kind);
  RS_FIELD(RsFootprintView, padding);

  RS_PUT(sizeof(RsLensCamera));
  RS_FIELD(RsLensCamera, rotation);
  RS_FIELD(RsLensCamera, center);
  RS_FIELD(RsLensCamera, fx);
  RS_FIELD(RsLensCamera, fy);
  RS_FIELD(RsLensCamera, cx);
  RS_FIELD(RsLensCamera, cy);
  RS_FIELD(RsLensCamera, k1);
  RS_FIELD(RsLensCamera, k2);
  RS_FIELD(RsLensCamera, k3);
  RS_FIELD(RsLensCamera, k4);
  RS_FIELD(RsLensCamera, p1);
  RS_FIELD(RsLensCamera, p2);
  RS_FIELD(RsLensCamera, limit);
  RS_FIELD(RsLensCamera, image_limit);
  RS_FIELD(RsLensCamera, aperture);
  RS_FIELD(RsLensCamera, focus_distance);
  RS_FIELD(RsLensCamera, width);
  RS_FIELD(RsLensCamera, height);
  RS_FIELD(RsLensCamera, jitter);
  RS_FIELD(RsLensCamera, sample);
  RS_FIELD(RsLensCamera, seed_lo);
  RS_FIELD(RsLensCamera, seed_hi);

  RS_PUT(sizeof(RsLensTile));
  RS_FIELD(RsLensTile, x0);
  RS_FIELD(RsLensTile, y0);
  RS_FIELD(RsLensTile, x1);
  RS_FIELD(RsLensTile, y1);
  RS_FIELD(RsLensTile, face);
  RS_FIELD(RsLensTile, cosine);
  RS_FIELD(RsLensTile, padding);

  layout[0] = next;
}
