"""Driven runs that are followed to their end, and that go on in another way from the end of a part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from mpi4py import MPI

from faultgouge.analysis import Packing, Slip
from faultgouge.pywrap import DriveCheckpoint, DriveSample, DriveStep, Scene, drive, settle_for_drive


@dataclass(frozen=True)
class Moment:
    """The end of a part of a run: the rows of the series up to there, and the state of LAMMPS."""

    rows: list[DriveSample]
    checkpoint: DriveCheckpoint

    @property
    def time(self) -> float:
        """Since the beginning."""
        return self.rows[-1].time

    def go_on(self, scene: Scene, start: Packing) -> Iterator[DriveStep]:
        """What follows in another scene, whose run is the same to the bit up to here."""
        return drive(scene, start, self.rows, self.checkpoint, communicator=MPI.COMM_SELF)


@dataclass(frozen=True)
class DrivenRun:
    """A run from the settled packing: the ends of its parts, and its slips."""

    start: Packing
    moments: list[Moment]
    slips: list[Slip]

    @classmethod
    def of(cls, scene: Scene, slips: int | None = None) -> DrivenRun:
        """Follow the run of a scene to its end, or to the end of so many slips."""
        start = settle_for_drive(scene, MPI.COMM_SELF)
        rows, moments, found = list[DriveSample](), list[Moment](), list[Slip]()

        def keep(reached: DriveCheckpoint) -> None:
            moments.append(Moment(rows.copy(), reached))

        for step in drive(scene, start, keep=keep, communicator=MPI.COMM_SELF):
            rows.append(step.sample)
            found += [step.slip] if step.slip else []
            if len(found) == slips:
                break
        return cls(start, moments, found)
