"""Train the network of the detector ``learned`` on BSDS500's training images and write it as ONNX.

    python -m benchmarks.quality.edges.train --all --out services/zv/edge/detectors/learned.onnx
    python -m benchmarks.quality.edges.train --out benchmarks/quality/edges/learned_160.onnx

It needs PyTorch (1.13 or newer) and ``onnx``, which nothing else in the project needs, and the
folder ``bsds_train`` below ``$ZV_TEST_DATA`` or ``../shared/data``. The run is seeded and takes
about 45 minutes on one core that multiplies numbers of 16 bits (``avx512_bf16``), and longer on
others. With ``--seconds`` it stops early; the same command goes on from ``--checkpoint`` until all
steps are done. A run in parts gives the weights of a run in one.

The detector's weights are trained on all 200 images. Without ``--all``, the last 40 by name are not
trained on: with those weights, ``benchmarks.quality.edges`` scores the method on these 40.

The network is an encoder of four scales on the half-size picture, each a strided and some added 3x3
convolutions, with the mean over the picture at the coarsest, and a decoder that adds each scale to
the next finer one (after O. Ronneberger, P. Fischer, T. Brox, "U-Net", 2015). Channels are
multiples of 16, which is what OpenCV's convolutions are fast with. The target is the share of
annotators that drew a boundary within one pixel, as a probability. Rotation, scale, mirroring,
brightness, contrast, tint, grey pictures and sensor noise vary the pictures, and the weights that
are written are an exponential moving average over the last steps.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn
from torch.nn import functional

from benchmarks.quality.data import found
from benchmarks.quality.edges import images
from zv.edge.detectors.learned import network_planes

CROP = 160  # side of a training picture at half size, pixels
BATCH = 8
AVERAGE = 0.999  # of the moving average of the weights, per step
POSITIVE_WEIGHT = 3.0  # boundaries are a twentieth of the pixels


def convolution(inputs: int, outputs: int, *, stride: int = 1, dilation: int = 1) -> nn.Sequential:
    """Return a 3x3 convolution with batch normalisation and ReLU."""
    return nn.Sequential(
        nn.Conv2d(inputs, outputs, 3, stride, dilation, dilation, bias=False),
        nn.BatchNorm2d(outputs),
        nn.ReLU(inplace=True),
    )


class Residual(nn.Sequential):
    """Residual convolutions of equal size, one for each dilation."""

    def __init__(self, channels: int, *dilations: int) -> None:
        super().__init__(*(convolution(channels, channels, dilation=each) for each in dilations))

    def forward(self, maps: Tensor) -> Tensor:
        """Return the sums."""
        for layer in self:
            maps = maps + layer(maps)
        return maps


class EdgeNetwork(nn.Module):
    """Logits of the probabilities of boundaries of planes (n, 6, h, w); h, w multiples of 16.

    The result is (n, 4, h / 2, w / 2): channel 2 y + x is the pixel (y, x) of a square of 2 x 2.
    """

    def __init__(self) -> None:
        super().__init__()
        self.fine = nn.Sequential(convolution(6, 16, stride=2), Residual(16, 1))
        self.middle = nn.Sequential(convolution(16, 32, stride=2), Residual(32, 1, 1))
        self.coarse = nn.Sequential(convolution(32, 64, stride=2), Residual(64, 1, 1))
        self.context = nn.Sequential(convolution(64, 64, stride=2), Residual(64, 1, 2, 4))
        self.whole = nn.Conv2d(64, 64, 1)
        self.lower3 = nn.Conv2d(64, 64, 1)
        self.join3 = Residual(64, 1, 1)
        self.lower2 = nn.Conv2d(64, 32, 1)
        self.join2 = Residual(32, 1, 1)
        self.lower1 = nn.Conv2d(32, 16, 1)
        self.out = nn.Conv2d(16, 4, 1)  # the four pixels of a square of 2 x 2
        self.sides = nn.ModuleList([nn.Conv2d(32, 1, 1), nn.Conv2d(64, 1, 1)])  # for training

    def scales(self, planes: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return logits (n, 4, h / 2, w / 2), and (n, 1, h / 4, w / 4) and half of that."""
        fine = self.fine(planes)
        middle = self.middle(fine)
        coarse = self.coarse(middle)
        context = self.context(coarse)
        context = context + self.whole(functional.adaptive_avg_pool2d(context, 1))
        coarse = self.join3(functional.relu(coarse + doubled(self.lower3(context))))
        middle = self.join2(functional.relu(middle + doubled(self.lower2(coarse))))
        fine = functional.relu(fine + doubled(self.lower1(middle)))
        return self.out(fine), self.sides[0](middle), self.sides[1](coarse)

    def forward(self, planes: Tensor) -> Tensor:
        """Return the logits."""
        return self.scales(planes)[0]


def doubled(maps: Tensor) -> Tensor:
    """Return maps at twice the size, each pixel repeated."""
    return functional.interpolate(maps, scale_factor=2.0, mode="nearest")


@dataclass(frozen=True, slots=True)
class Example:
    """A picture and the share of annotators that drew a boundary at each pixel.

    Args:
        picture: (height, width, 3) uint8, BGR.
        share: (height, width) uint8; 255: all of them.
    """

    picture: NDArray[np.uint8]
    share: NDArray[np.uint8]


def load_example(folder: Path, name: str) -> Example:
    """Read a picture and its annotators' boundaries, each widened by one pixel."""
    drawn = images.read(folder, name)
    square = np.ones((3, 3), np.uint8)
    widened = [cv2.dilate(each.astype(np.uint8), square) for each in drawn.boundaries]
    return Example(drawn.picture, (np.mean(widened, axis=0) * 255).astype(np.uint8))


def varied(example: Example, random: np.random.Generator) -> tuple[Tensor, Tensor]:
    """Return the planes and the target of a random half-size view of an example."""
    height, width = example.share.shape
    scale = 0.5 * math.exp(random.uniform(math.log(0.65), math.log(1.5)))
    rotation = cv2.getRotationMatrix2D((0, 0), random.uniform(0, 360), scale)
    if random.random() < 0.5:
        rotation[:, 0] *= -1
    reach = CROP / 4
    centre = (random.uniform(reach, width - reach), random.uniform(reach, height - reach))
    rotation[:, 2] = CROP / 2 - rotation[:, :2] @ np.array(centre)
    picture, share = (
        cv2.warpAffine(
            image, rotation, (CROP, CROP), flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101
        )
        for image in (example.picture, example.share)
    )
    planes = network_planes(recoloured(np.asarray(picture, np.uint8), random))
    return torch.from_numpy(planes), torch.from_numpy(share).float()[None] / 255


def recoloured(picture: NDArray[np.uint8], random: np.random.Generator) -> NDArray[np.uint8]:
    """Return a picture with other colours, brightness, contrast and noise."""
    gray, noisy = random.random(2) < (0.15, 0.4)
    tint = random.uniform(0.88, 1.12, 3)
    if gray:
        picture = cv2.cvtColor(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)
        tint[:] = tint[0]
    levels = 255 * (np.arange(256)[:, None] / 255) ** math.exp(random.uniform(-0.25, 0.25)) * tint
    levels = (levels - 128) * random.uniform(0.7, 1.25) + 128 + random.uniform(-25, 25)
    table = np.clip(np.rint(levels), 0, 255).astype(np.uint8)
    picture = cv2.LUT(picture, table.reshape(256, 1, 3))
    if noisy:
        noise = np.empty(picture.shape, np.int16)
        cv2.setRNGSeed(int(random.integers(2**31 - 1)))
        cv2.randn(noise, 0, random.uniform(1, 6))
        picture = cv2.add(picture, noise, dtype=cv2.CV_8U)
    return np.asarray(picture, np.uint8)


def loss_of(logits: Tensor, target: Tensor) -> Tensor:
    """Return the cross entropy with the share of annotators, boundaries weighing more."""
    weight = torch.tensor(POSITIVE_WEIGHT)
    return functional.binary_cross_entropy_with_logits(logits, target, pos_weight=weight)


class Training:
    """The state of a run: network, its average, optimiser and random numbers."""

    def __init__(self, cycles: list[int], rate: float) -> None:
        torch.manual_seed(0)
        self.cycles, self.rate, self.step = cycles, rate, 0
        self.network = EdgeNetwork().to(memory_format=torch.channels_last)
        with torch.no_grad():
            for last in (self.network.out, *self.network.sides):
                last.bias.fill_(-2.0)
        self.average = {name: value.clone() for name, value in self.network.state_dict().items()}
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), rate, weight_decay=2e-2, foreach=True
        )

    @property
    def steps(self) -> int:
        """The number of steps of all cycles."""
        return sum(self.cycles)

    def rate_now(self) -> float:
        """Return the step size: a half cosine in each cycle, each from half of the last's height.

        Source: I. Loshchilov, F. Hutter, "SGDR: Stochastic Gradient Descent with Warm Restarts",
        2017.
        """
        step, cycle = self.step, 0
        while step >= self.cycles[cycle]:
            step -= self.cycles[cycle]
            cycle += 1
        warm = min(1.0, (self.step + 1) / 100)
        falling = (1 + math.cos(math.pi * step / self.cycles[cycle])) / 2
        return self.rate * 0.5**cycle * warm * (0.01 + 0.99 * falling)

    def advance(self, examples: list[Example]) -> float:
        """Make one step of the optimiser and return the loss."""
        random = np.random.default_rng(self.step)  # a run in parts equals a run in one
        for group in self.optimiser.param_groups:
            group["lr"] = self.rate_now()
        pairs = [varied(examples[i], random) for i in random.integers(len(examples), size=BATCH)]
        target = torch.stack([pair[1] for pair in pairs])
        planes = torch.cat([pair[0] for pair in pairs]).to(memory_format=torch.channels_last)
        with torch.autocast("cpu", torch.bfloat16):
            logits, *sides = (each.float() for each in self.network.scales(planes))
        loss = loss_of(functional.pixel_shuffle(logits, 2), target)
        total = loss
        for factor, side in zip((4, 8), sides, strict=True):
            total = total + 0.3 * loss_of(side, functional.avg_pool2d(target, factor))
        self.optimiser.zero_grad(set_to_none=True)
        total.backward()
        self.optimiser.step()
        keep = min(AVERAGE, (1 + self.step) / (10 + self.step))
        with torch.no_grad():
            for name, value in self.network.state_dict().items():
                if value.dtype.is_floating_point:
                    self.average[name].lerp_(value, 1 - keep)
        self.step += 1
        return float(loss)

    def save(self, path: Path) -> None:
        """Write the state."""
        state = {
            "step": self.step,
            "network": self.network.state_dict(),
            "average": self.average,
            "optimiser": self.optimiser.state_dict(),
        }
        torch.save(state, path)

    def load(self, path: Path) -> None:
        """Go on from a written state."""
        state = torch.load(path)
        self.step, self.average = state["step"], state["average"]
        self.network.load_state_dict(state["network"])
        self.optimiser.load_state_dict(state["optimiser"])


def export(average: dict[str, Tensor], path: Path) -> None:
    """Write the network with these weights as ONNX, weights as numbers of 16 bits."""
    network = EdgeNetwork()
    network.load_state_dict(average)
    network.eval()
    example = torch.zeros(1, 6, 240, 320)
    names = {"input_names": ["planes"], "output_names": ["logits"]}
    fixed = {"dynamo": False} if "dynamo" in torch.onnx.export.__code__.co_varnames else {}
    torch.onnx.export(network, (example,), str(path), opset_version=13, **names, **fixed)
    onnx.save(halved(onnx.load(path)), path)


def halved(model: onnx.ModelProto) -> onnx.ModelProto:
    """Return a model whose weights are stored with 16 bits and become 32 bits when it is read."""
    casts = []
    for weights in model.graph.initializer:
        values = numpy_helper.to_array(weights)
        if values.dtype == np.float32 and values.ndim == 4:
            name = f"{weights.name}_half"
            casts.append(helper.make_node("Cast", [name], [weights.name], to=TensorProto.FLOAT))
            weights.CopyFrom(numpy_helper.from_array(values.astype(np.float16), name))
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)
    onnx.checker.check_model(model)
    return model


def main() -> None:
    """Train, or go on training, and write the network."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    arguments.add_argument("--out", type=Path, required=True, help="the ONNX file")
    arguments.add_argument("--checkpoint", type=Path, help="to go on from, if it exists")
    arguments.add_argument("--cycles", type=int, nargs="+", default=[14000, 20000], help="in steps")
    arguments.add_argument("--rate", type=float, default=4e-3)
    arguments.add_argument("--seconds", type=float, default=math.inf, help="stop after these")
    arguments.add_argument("--all", action="store_true", help="train on the held-back images too")
    options = arguments.parse_args()
    folders = found(images.FOLDER)
    if folders is None:
        raise SystemExit(1)
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
    names = images.image_names(folders[0], held_back=False)
    if options.all:
        names += images.image_names(folders[0], held_back=True)
    training = Training(options.cycles, options.rate)
    if options.checkpoint is not None and options.checkpoint.exists():
        training.load(options.checkpoint)
    end = time.monotonic() + options.seconds
    examples = [load_example(folders[0], name) for name in names]
    losses: list[float] = []
    while training.step < training.steps and time.monotonic() < end:
        losses.append(training.advance(examples))
        if training.step % 100 == 0:
            print(f"step {training.step} loss {np.mean(losses[-100:]):.4f}", flush=True)
        if training.step % 1000 == 0 and options.checkpoint is not None:
            training.save(options.checkpoint)
    if options.checkpoint is not None:
        training.save(options.checkpoint)
    export(training.average, options.out)
    print("done" if training.step == training.steps else f"stopped at step {training.step}")


if __name__ == "__main__":
    main()
