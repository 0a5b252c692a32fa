// SPDX-License-Identifier: Apache-2.0
#ifndef RS_SHARED_ALPHA_H
#define RS_SHARED_ALPHA_H

// Alpha at which adaptive radii end: a step of an 8-bit picture.
#define RS_MIN_ALPHA (1.0f / 255.0f)

#endif
