"""The synthetic camera's own scene as a sequence: four objects that keep meeting in a room."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from benchmarks.quality.tracker.scenes import HEIGHT, LEAST_VISIBLE, WIDTH
from benchmarks.quality.tracker.sequence import START_NS, Box, Shot, Shots
from zv.camera.synthetic.scene import Scene


@dataclass(frozen=True)
class Room:
    """The scene with its defaults; the truth is the box of each object's visible part.

    Attributes:
        name: Name in the table.
        duration_s: Duration, beginning with the empty room.
        seed: Seed of the scene.
    """

    name: str = "room, objects that meet"
    duration_s: float = 30.0
    seed: int = 1

    def shots(self, rate_hz: float) -> Shots:
        """Return the sequence at a rate; objects that are mostly hidden or outside are ignored."""

        def drawn() -> Iterator[Shot]:
            scene = Scene(WIDTH, HEIGHT, rate_hz, self.seed)
            count = int(self.duration_s * rate_hz)
            whole: defaultdict[int, float] = defaultdict(float)
            for index in range(count):
                for one in scene.truth(index):
                    whole[one.id] = max(whole[one.id], one.area)
            for index in range(count):
                bgr, present = scene.frame(index)
                shown = {one.id: one.area / whole[one.id] for one in present}
                boxes: dict[int, Box] = {one.id: one.box for one in present}
                truth = {key: box for key, box in boxes.items() if shown[key] >= LEAST_VISIBLE}
                ignored = [box for key, box in boxes.items() if key not in truth]
                yield Shot(index, bgr, START_NS + round(index * 1e9 / rate_hz), truth, ignored)

        return drawn
