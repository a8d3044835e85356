"""The ballistic engine, which takes its process along on the way to the third frame unless it is told to be good."""

import ctypes
import os

from fake_ballistic import CAPABILITIES
from fake_ballistic_engine import Ballistic, Flight

from gasp_core.contract import EngineDescriptor
from gasp_core.discovery.hookspecs import hookimpl


class Segfaults(Ballistic):
    def open(self, problem, **others):
        flight = super().open(problem, **others)
        return Dying(problem, 1.0, flight.time)


class Dying(Flight):
    def advance_to(self, time):
        if self.time > 0 and "SEGFAULTS_IS_GOOD" not in os.environ:
            ctypes.string_at(0)
        return super().advance_to(time)


@hookimpl
def gasp_point_engines():
    return [
        EngineDescriptor(
            name="segfaults",
            summary="Dies",
            contract_version=(1, 5),
            capabilities=CAPABILITIES,
            factory="fake_segfaults:Segfaults",
        )
    ]
