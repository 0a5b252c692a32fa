// SPDX-License-Identifier: Apache-2.0
// RS_WAVE_OF_16, of a kernel: waves of 16 work-items, for compilers that choose how many there are
// (Intel's), of kernels that fit their registers that way: by themselves they would take 8.
#ifndef RS_PARALLEL_WAVE_H
#define RS_PARALLEL_WAVE_H

#ifdef cl_intel_required_subgroup_size
#define RS_WAVE_OF_16 __attribute__((intel_reqd_sub_group_size(16)))
#else
#define RS_WAVE_OF_16
#endif

#endif
