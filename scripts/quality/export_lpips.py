#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes LPIPS as the ONNX file that `raysplats eval --lpips` takes: two pictures (1, 3, height, width) of any one size,
RGB in [-1, 1], in; one number out. Needs torch, torchvision and lpips (`pip install lpips`), which brings its own
weights and downloads those of the ImageNet network when it is first used.

An export of the package as it is would be refused, since OpenCV computes two things of it wrongly: a constant that both
pictures are divided by (it is in the weights of the first convolution here), and means over what the pictures' size was
at the export (a pooling of any size here)."""
import argparse
import inspect

import lpips
import torch

EXPORT_SIZE = 64  # pixels along a side of the pictures that are traced; the file takes all sizes


class Distance(torch.nn.Module):
    def __init__(self, net):
        super().__init__()
        self.features, self.heads = net.net, net.lins
        self.register_buffer("shift", net.scaling_layer.shift)
        with torch.no_grad():
            self.features.slice1[0].weight /= net.scaling_layer.scale

    def directions(self, picture):
        """The features of each layer, of length 1 at each pixel."""
        return [layer / (torch.sqrt(torch.sum(layer**2, dim=1, keepdim=True)) + 1e-10)
                for layer in self.features(picture - self.shift)]

    def forward(self, first, second):
        layers = zip(self.heads, self.directions(first), self.directions(second))
        return sum(torch.nn.functional.adaptive_avg_pool2d(head((a - b)**2), 1) for head, a, b in layers)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", metavar="NETWORK.onnx")
    parser.add_argument("--net", choices=("vgg", "alex", "squeeze"), default="vgg", help="default: vgg")
    args = parser.parse_args()
    network = Distance(lpips.LPIPS(net=args.net, verbose=False)).eval()
    pictures = [2 * torch.rand(1, 3, EXPORT_SIZE, EXPORT_SIZE) - 1 for _ in range(2)]
    sides = {2: "height", 3: "width"}
    # The exporter that newer versions prefer keeps the sizes as they are traced.
    older = {"dynamo": False} if "dynamo" in inspect.signature(torch.onnx.export).parameters else {}
    torch.onnx.export(network, tuple(pictures), args.output, opset_version=11, input_names=["picture", "photo"],
                      output_names=["distance"], dynamic_axes={"picture": sides, "photo": sides}, **older)


if __name__ == "__main__":
    main()
