#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A COLMAP data set (images/ or a reduced images_N/, sparse/0/*.bin) with few of its photos, for docs/training.md: TRAIN
evenly spread training photos and a third as many held-out ones, of those that the whole data set holds out (every
eighth). They are named so that `raysplats train OUT --test-every 4` holds out the same ones. Of the sparse points those
stay that two training photos show. OUT must not exist; its photos are links."""
import argparse
import pathlib
import struct
import sys

HELD_OUT, TEST_EVERY = 8, 4
FOLDERS = ("images", "images_2", "images_4", "images_8")


class Reader:
    def __init__(self, file):
        self.bytes, self.at = file.read_bytes(), 0

    def numbers(self, form):
        found = struct.unpack_from("<" + form, self.bytes, self.at)
        self.at += struct.calcsize("<" + form)
        return found

    def skip(self, count):
        """Those bytes, as they are."""
        self.at += count
        return self.bytes[self.at - count:self.at]


def read_images(file):
    """(name, number, what stands before the name, what stands behind it) of each, by name."""
    reader, images = Reader(file), []
    for _ in range(reader.numbers("Q")[0]):
        number = struct.unpack_from("<I", reader.bytes, reader.at)[0]
        pose = reader.skip(4 + 7 * 8 + 4)
        name = reader.skip(reader.bytes.index(b"\0", reader.at) - reader.at).decode()
        reader.skip(1)
        count = reader.numbers("Q")[0]
        images.append((name, number, pose, struct.pack("<Q", count) + reader.skip(24 * count)))
    return sorted(images)


def kept_points(file, numbers):
    """The points that two of the images show, with what these say of them."""
    reader, points = Reader(file), []
    for _ in range(reader.numbers("Q")[0]):
        point = reader.skip(8 + 3 * 8 + 3 + 8)
        flat = reader.numbers(f"{2 * reader.numbers('Q')[0]}I")
        track = [seen for seen in zip(flat[::2], flat[1::2]) if seen[0] in numbers]
        if len(track) >= 2:
            points.append(point + struct.pack("<Q", len(track)) + b"".join(struct.pack("<2I", *seen) for seen in track))
    return points


def spread(images, count):
    return [images[(2 * i + 1) * len(images) // (2 * count)] for i in range(count)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA", type=pathlib.Path)
    parser.add_argument("out", metavar="OUT", type=pathlib.Path)
    parser.add_argument("train", metavar="TRAIN", type=int)
    arguments = parser.parse_args()
    data, out, count = arguments.data, arguments.out, arguments.train
    images = read_images(data / "sparse/0/images.bin")
    held_out = images[::HELD_OUT]
    others = [image for i, image in enumerate(images) if i % HELD_OUT]
    if not 3 <= count <= len(others) or count // 3 > len(held_out):
        sys.exit(f"{data} has {len(others)} training and {len(held_out)} held-out photos: {count} and a third of it are not to be had")
    train = spread(others, count)
    turns, tests = iter(train), iter(spread(held_out, count // 3))
    order = [next(tests if i % TEST_EVERY == 0 else turns) for i in range(count + count // 3)]
    photos = next((data / name for name in FOLDERS if (data / name / images[0][0]).exists()), None)
    if photos is None:
        sys.exit(f"{data} has {images[0][0]} in none of {', '.join(FOLDERS)}")
    (out / photos.name).mkdir(parents=True)
    (out / "sparse/0").mkdir(parents=True)
    rows = []
    for i, (name, _, pose, seen) in enumerate(order):
        renamed = f"{i:03d}_{pathlib.Path(name).name}"
        (out / photos.name / renamed).symlink_to((photos / name).resolve())
        rows.append(pose + renamed.encode() + b"\0" + seen)
    points = kept_points(data / "sparse/0/points3D.bin", {image[1] for image in train})
    for name, parts in (("images.bin", rows), ("points3D.bin", points)):
        (out / "sparse/0" / name).write_bytes(struct.pack("<Q", len(parts)) + b"".join(parts))
    (out / "sparse/0/cameras.bin").write_bytes((data / "sparse/0/cameras.bin").read_bytes())
    print(f"{out}: {len(train)} training and {count // 3} held-out photos, {len(points)} points")


if __name__ == "__main__":
    try:
        main()
    except OSError as error:
        sys.exit(str(error))
