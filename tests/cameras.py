"""Cameras for tests: shots that are there already, and the first shots of another camera."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice

from puppet.tracking.cameras.camera import Camera, CameraInfo, Shot


class Shots:
    """Shots that are there already."""

    def __init__(self, shots: Iterable[Shot], info: CameraInfo | None = None) -> None:
        self._shots = list(shots)
        self.info = info or CameraInfo("shots", "test", 20.0)
        self.trouble = ""
        self.warnings: tuple[str, ...] = ()
        self.closed = False

    def __len__(self) -> int:
        return len(self._shots)

    def __iter__(self) -> Iterator[Shot]:
        return iter(self._shots)

    def close(self) -> None:
        self.closed = True


class First:
    """The first shots of a camera."""

    def __init__(self, camera: Camera, count: int) -> None:
        self._camera, self._count = camera, count
        self.info = camera.info
        self.trouble = ""
        self.warnings: tuple[str, ...] = ()

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Shot]:
        return islice(self._camera, self._count)

    def close(self) -> None:
        self._camera.close()
