"""Frames at a steady rate."""

from __future__ import annotations

import time


class Pace:
    """Waits for the next frame. One that comes late by more than a period is counted; those that it has missed are left out."""

    def __init__(self, period: float) -> None:
        self.period = period  # s
        self.frames = self.late = self.left_out = 0
        self.latest = 0.0  # s: how much too late a frame was at most
        self._next = time.monotonic()

    def wait(self) -> int:
        """Gives how many periods this frame is after the last one."""
        now = time.monotonic()
        if now < self._next:
            time.sleep(self._next - now)
            now = time.monotonic()
        behind = now - self._next
        missed = int(behind / self.period)
        self.frames += 1
        self.late += missed > 0
        self.left_out += missed
        self.latest = max(self.latest, behind)
        self._next += (missed + 1) * self.period
        return missed + 1

    def __str__(self) -> str:
        late = f"{self.late} late by more than {1e3 * self.period:.0f} ms (at most {1e3 * self.latest:.0f} ms)"
        return f"{self.frames} frames, {late}, {self.left_out} left out"
