# SPDX-License-Identifier: Apache-2.0
"""The kernel programs that the host builds on a GPU, with the definitions it gives them there, in the forms that a default
training run, a render, rays of one's own, mirrors and `bench` ask for."""
import os

KERNELS = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "cl")
# Context::Impl::program (host/device/context.cpp).
COMPILER = ["-cl-mad-enable"]

# packet_layout.cpp and camera_tracer.cpp: a packet per work-group, or one ray per work-item, in tiles of 16. SUBGROUP 1 is what
# a device with subgroups is tried with, 2 what it is asked for by name.
CAMERA = dict(LANES=1, TILE=16, CHUNK=16, LENS=0)
GROUP_CAMERA = dict(CAMERA, GROUP=32)
# packet_kernels.cpp: what the first launch leaves, on a device with 32 kB of local memory or more.
CROWDED = dict(CROWDED=1, OPEN_LOCAL=64)
GROUP_FORWARD = dict(GROUP_CAMERA, PEAK_ORDER=1, WITH_DEPTH=0, KEEP_HITS=0)
FORWARD = dict(CAMERA, BLOCK=1, PENDING=48, STRETCHES=1, PEAK_ORDER=1, WITH_DEPTH=0, KEEP_HITS=0)
# candidate_lists.cpp, gaussian_kernel.cpp.
VIEW = dict(SIGMOID_SCALE=0, PEAK_ORDER=1, ADAPTIVE_RADIUS=1, LENS=0, VIEW_FOOTPRINT=1, SH_DEGREE=3, SH_COEFFICIENTS=16, LANES=1, GROUP=64)
LISTS = dict(TILE=16, PEAK_ORDER=1, LENS=0, LANES=1, GROUP=64)
FINALIZE = dict(SIGMOID_SCALE=0, POSE=0, ACCUMULATE=0, RAISE_CLAMPED=1, LENS=0, VIEW_FOOTPRINT=1, SH_DEGREE=3, SH_COEFFICIENTS=16, LANES=1, GROUP=64)
# gradient_sums.cpp; the least weight is that of backward passes in training.
ATOMIC = dict(PRIVATE_COPIES=0, EXACT_SUMS=0, FLOAT_ATOMICS=1, LEAST_WEIGHT="1e-3f")
SWAP = dict(ATOMIC, FLOAT_ATOMICS=0)
EXACT = dict(SWAP, EXACT_SUMS=1)
# lbvh.cpp, ray_launch.cpp, ray_backward.cpp.
TREE = dict(LANES=4, TRAIL=1)
WALK = dict(TREE, KEPT=10, GROUP=64, NEAR_LIMIT=0, LENS=0, ADAPTIVE_RADIUS=1, PEAK_ORDER=1, SH_DEGREE=3)
RAY_BACKWARD = dict(WALK, WITH_RAY_GRADIENT=0, RAISE_CLAMPED=1)
RAY_GRADIENTS = dict(SIGMOID_SCALE=0, LANES=1, GROUP=64)
# image_loss.cpp: groups, or what devices get whose groups are smaller.
LOSS = dict(LANES=1, TILE=16, ROWS=1, PIXEL_L2=0)
# chunk_shape.cpp.
CHUNKS = dict(GROUP=256)

# Name, file below cl/, definitions.
PROGRAMS = [
    ("group forward train", "trace/group_forward.cl", dict(GROUP_FORWARD, KEEP_HITS=1)),
    ("group forward train 64", "trace/group_forward.cl", dict(GROUP_FORWARD, KEEP_HITS=1, GROUP=64)),
    ("group forward train crowded", "trace/group_forward.cl", dict(GROUP_FORWARD, KEEP_HITS=1, **CROWDED)),
    ("group forward render", "trace/group_forward.cl", GROUP_FORWARD),
    ("group forward render crowded", "trace/group_forward.cl", dict(GROUP_FORWARD, **CROWDED)),
    ("group forward depth", "trace/group_forward.cl", dict(GROUP_FORWARD, PEAK_ORDER=0, WITH_DEPTH=1)),
    ("group forward around", "trace/group_forward.cl", dict(GROUP_FORWARD, LENS=2, KEEP_HITS=1)),
    ("group backward atomic", "trace/group_backward.cl", dict(GROUP_CAMERA, **ATOMIC)),
    ("group backward atomic crowded", "trace/group_backward.cl", dict(GROUP_CAMERA, **ATOMIC, **CROWDED)),
    ("group backward atomic 64", "trace/group_backward.cl", dict(GROUP_CAMERA, **ATOMIC, GROUP=64)),
    ("group backward swap", "trace/group_backward.cl", dict(GROUP_CAMERA, **SWAP)),
    ("group backward exact", "trace/group_backward.cl", dict(GROUP_CAMERA, **EXACT)),
    ("subgroup forward train", "trace/group_forward.cl", dict(GROUP_FORWARD, KEEP_HITS=1, SUBGROUP=1)),
    ("subgroup forward train 16", "trace/group_forward.cl", dict(GROUP_FORWARD, KEEP_HITS=1, SUBGROUP=2, GROUP=16)),
    ("subgroup forward train 64", "trace/group_forward.cl", dict(GROUP_FORWARD, KEEP_HITS=1, SUBGROUP=1, GROUP=64)),
    ("subgroup forward train crowded", "trace/group_forward.cl", dict(GROUP_FORWARD, KEEP_HITS=1, SUBGROUP=1, **CROWDED)),
    ("subgroup forward around", "trace/group_forward.cl", dict(GROUP_FORWARD, LENS=2, KEEP_HITS=1, SUBGROUP=1)),
    ("subgroup backward atomic", "trace/group_backward.cl", dict(GROUP_CAMERA, **ATOMIC, SUBGROUP=1)),
    ("subgroup backward atomic 16", "trace/group_backward.cl", dict(GROUP_CAMERA, **ATOMIC, SUBGROUP=2, GROUP=16)),
    ("subgroup backward atomic 64", "trace/group_backward.cl", dict(GROUP_CAMERA, **ATOMIC, SUBGROUP=1, GROUP=64)),
    ("subgroup backward atomic crowded", "trace/group_backward.cl", dict(GROUP_CAMERA, **ATOMIC, SUBGROUP=1, **CROWDED)),
    ("subgroup backward exact", "trace/group_backward.cl", dict(GROUP_CAMERA, **EXACT, SUBGROUP=1)),
    ("group backward depth", "trace/group_backward.cl", dict(GROUP_CAMERA, **ATOMIC, DEPTH_GRADIENT=1)),
    ("segments", "trace/stream_segments.cl", dict(GROUP_CAMERA, DEPTH_GRADIENT=0)),
    ("segments 64", "trace/stream_segments.cl", dict(GROUP_CAMERA, DEPTH_GRADIENT=0, GROUP=64)),
    ("segments around", "trace/stream_segments.cl", dict(GROUP_CAMERA, DEPTH_GRADIENT=1, LENS=2)),
    ("forward train", "trace/camera_forward.cl", dict(FORWARD, KEEP_HITS=1)),
    ("forward render", "trace/camera_forward.cl", FORWARD),
    ("forward entry", "trace/camera_forward.cl", dict(FORWARD, PEAK_ORDER=0)),
    ("forward depth", "trace/camera_forward.cl", dict(FORWARD, WITH_DEPTH=1)),
    ("forward lens", "trace/camera_forward.cl", dict(FORWARD, LENS=1, KEEP_HITS=1)),
    ("forward around", "trace/camera_forward.cl", dict(FORWARD, LENS=2, KEEP_HITS=1)),
    ("backward atomic", "trace/camera_backward.cl", dict(CAMERA, **ATOMIC)),
    ("backward exact", "trace/camera_backward.cl", dict(CAMERA, **EXACT)),
    ("backward depth", "trace/camera_backward.cl", dict(CAMERA, **ATOMIC, DEPTH_GRADIENT=1)),
    ("prepare sh3", "trace/prepare_view.cl", VIEW),
    ("prepare sh0", "trace/prepare_view.cl", dict(VIEW, SH_DEGREE=0, SH_COEFFICIENTS=1)),
    ("finalize group sh3", "trace/group_finalize.cl", FINALIZE),
    ("prepare plain", "trace/prepare_view.cl", dict(VIEW, VIEW_FOOTPRINT=0)),
    ("finalize group plain", "trace/group_finalize.cl", dict(FINALIZE, VIEW_FOOTPRINT=0)),
    ("finalize group pose", "trace/group_finalize.cl", dict(FINALIZE, POSE=1)),
    ("finalize group depth", "trace/group_finalize.cl", dict(FINALIZE, DEPTH_GRADIENT=1)),
    ("finalize group further", "trace/group_finalize.cl", dict(FINALIZE, ACCUMULATE=1)),
    ("lists", "trace/tile_lists.cl", LISTS),
    ("lists lens", "trace/tile_lists.cl", dict(LISTS, LENS=1)),
    ("lens tiles", "trace/lens_tiles.cl", dict(CAMERA_MODEL=1, TILE=16)),
    ("exact lines", "trace/gradient_sums.cl", {}),
    ("camera rays", "trace/camera_rays.cl", dict(CAMERA_MODEL=1)),
    ("sky", "trace/sky.cl", dict(CAMERA_MODEL=1, SKY_DEGREE=2)),
    ("normals", "light/normal_gaussians.cl", {}),
    ("rays", "trace/ray_tracer.cl", WALK),
    ("rays entry", "trace/ray_tracer.cl", dict(WALK, PEAK_ORDER=0, ADAPTIVE_RADIUS=0)),
    ("rays leading", "trace/ray_tracer.cl", dict(WALK, LEADING=1)),
    ("cones", "trace/ray_tracer.cl", dict(WALK, CONES=1)),
    ("cones entry", "trace/ray_tracer.cl", dict(WALK, CONES=1, PEAK_ORDER=0, ADAPTIVE_RADIUS=0)),
    ("cones leading", "trace/ray_tracer.cl", dict(WALK, CONES=1, LEADING=1)),
    ("ray order", "trace/ray_launch.cl", TREE),
    ("ray backward atomic", "trace/ray_backward.cl", dict(RAY_BACKWARD, **ATOMIC)),
    ("ray backward swap", "trace/ray_backward.cl", dict(RAY_BACKWARD, **SWAP)),
    ("ray backward exact", "trace/ray_backward.cl", dict(RAY_BACKWARD, **EXACT)),
    ("ray backward of rays", "trace/ray_backward.cl", dict(RAY_BACKWARD, **ATOMIC, WITH_RAY_GRADIENT=1)),
    ("ray records", "trace/ray_gradients.cl", RAY_GRADIENTS),
    ("ray gradients", "trace/ray_gradients.cl", dict(RAY_GRADIENTS, SH_DEGREE=3, SH_COEFFICIENTS=16)),
    ("gaussian blocks", "trace/ray_tree.cl", dict(TREE, SIGMOID_SCALE=0, ADAPTIVE_RADIUS=1)),
    ("cone blocks", "trace/ray_tree.cl", dict(TREE, SIGMOID_SCALE=0, ADAPTIVE_RADIUS=1, CONES=1)),
    ("bounds", "bvh/gaussian_bounds.cl", dict(SIGMOID_SCALE=0, ADAPTIVE_RADIUS=1)),
    ("curve", "bvh/curve.cl", dict(CHUNKS, LANES=4)),
    ("tree", "bvh/lbvh.cl", TREE),
    ("tree order", "bvh/leaf_order_group.cl", dict(LANES=4, GROUP=64)),
    ("tree cost", "bvh/tree_cost.cl", dict(CHUNKS, **TREE)),
    ("sort arrays", "parallel/radix_sort.cl", dict(CHUNKS, RS_SOURCE_PAIRS=0, RS_TARGET_PAIRS=0)),
    ("sort to pairs", "parallel/radix_sort.cl", dict(CHUNKS, RS_SOURCE_PAIRS=0, RS_TARGET_PAIRS=1)),
    ("sort pairs", "parallel/radix_sort.cl", dict(CHUNKS, RS_SOURCE_PAIRS=1, RS_TARGET_PAIRS=1)),
    ("sort from pairs", "parallel/radix_sort.cl", dict(CHUNKS, RS_SOURCE_PAIRS=1, RS_TARGET_PAIRS=0)),
    ("scan", "parallel/scan.cl", CHUNKS),
    ("loss group", "train/group_loss.cl", dict(PIXEL_L2=0, SSIM_GRADIENT=1)),
    ("loss prepare", "train/loss_prepare.cl", LOSS),
    ("loss ssim", "train/loss_ssim.cl", dict(LOSS, SSIM_GRADIENT=1)),
    ("photo reduce", "train/photo_cache.cl", {}),
    ("loss reduce", "train/loss_reduce.cl", {}),
    ("adam sh3", "train/adam.cl", dict(LANES=1, BLOCK=256, GROUP=64, SH_FLOATS=48)),
    ("adam sh0", "train/adam.cl", dict(LANES=1, BLOCK=256, GROUP=64, SH_FLOATS=3)),
    ("densify", "train/density_control.cl", dict(SH_COEFFICIENTS=16, SIGMOID_SCALE=0)),
    ("footprint", "train/footprint.cl", dict(SIGMOID_SCALE=0)),
    ("parameter mean", "train/parameter_mean.cl", dict(SH_FLOATS=48)),
    ("mcmc", "train/mcmc.cl", dict(SIGMOID_SCALE=0)),
    ("guard", "train/step_guard.cl", {}),
    ("gradient tree", "train/gradient_tree.cl", dict(SH_FLOATS=48)),
    ("view sizes", "trace/view_sizes.cl", {}),
    ("exposure", "train/exposure.cl", {}),
    ("exposure cut-outs", "train/exposure.cl", dict(CUT_OUT=1)),
    ("depth loss", "train/depth_supervision.cl", {}),
    ("sky step", "train/sky_adam.cl", {}),
    ("validate", "train/model_validator.cl", {}),
    ("waves", "light/path_tracer.cl", {}),
    ("first hits", "light/first_hits.cl", {}),
    ("mirror paths", "light/mirror_paths.cl", {}),
    ("surface rays", "light/triangle_tracer.cl", dict(TREE, GROUP=64)),
    ("triangle blocks", "light/triangle_blocks.cl", TREE),
    ("ceilings", "bench/ceilings.cl", dict(CHAINS=8)),
]

# What GPUs never get.
CPU_ONLY = {"bvh/leaf_order.cl", "trace/finalize_gradients.cl"}


def unlisted():
    """Kernel files that no program above names. Probes are for tests."""
    listed = {path for _, path, _ in PROGRAMS} | CPU_ONLY
    found = set()
    for folder, _, names in os.walk(KERNELS):
        for name in names:
            if name.endswith(".cl") and not name.endswith("_probe.cl"):
                found.add(os.path.relpath(os.path.join(folder, name), KERNELS).replace(os.sep, "/"))
    return sorted(found - listed)


def offered(definitions, vendor):
    """Whether the vendor's OpenCL has what the program asks for: NVIDIA's has no subgroups."""
    return not (definitions.get("SUBGROUP") and vendor == "nvidia")


def flags(definitions, vendor):
    """As the host builds them; native float additions take a later language where they come by cl_ext_float_atomics, which is
    on Intel's devices, and subgroups take the latest of the device."""
    standard = "CL1.2"
    if vendor == "intel" and (definitions.get("FLOAT_ATOMICS") or definitions.get("SUBGROUP")):
        standard = "CL3.0"
    elif definitions.get("SUBGROUP"):
        standard = "CL2.0"
    return [f"-cl-std={standard}", *COMPILER, *(f"-D{name}={value}" for name, value in sorted(definitions.items()))]


def resolve(path, seen=None):
    """The source as host/device/kernel_source.cpp gives it to the driver: every included file once, in its place."""
    seen = set() if seen is None else seen
    if path in seen:
        return ""
    seen.add(path)
    out = [f'#line 1 "{path}"\n']
    with open(os.path.join(KERNELS, path), encoding="utf-8") as file:
        for number, line in enumerate(file.read().splitlines(), 1):
            if line.startswith('#include "'):
                out.append(resolve(line.split('"')[1], seen))
                out.append(f'#line {number + 1} "{path}"\n')
            else:
                out.append(line + "\n")
    return "".join(out)
