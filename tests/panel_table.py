"""A served plant and the controller of a panel in one process, joined by datagrams without sockets and clocks."""

import numpy as np

from lhpost6_pin.control import load_controller
from lhpost6_pin.control.plug import Feedback
from lhpost6_pin.core.names import SAMPLE_RATE
from lhpost6_pin.interfaces.link import Datagram, Kind, LinkMode, Reading, ServedPlant, decode, encode
from lhpost6_pin.interfaces.link.protocol import MOTION
from lhpost6_pin.mechanics.equilibrium import find_equilibrium, parked_pose
from lhpost6_pin.mechanics.plant import make_plant
from lhpost6_pin.panel.engine import Engine
from lhpost6_pin.panel.recording import Recording
from lhpost6_pin.panel.rows import Rows
from lhpost6_pin.panel.worker import panel_numbers


class Table:
    """A served plant and the controller of a panel, joined by datagrams in one process."""

    def __init__(self, machine, parked=False):
        self.plant = make_plant(machine)
        rest = find_equilibrium(self.plant)
        self.rows = Rows(len(machine.actuators), len(machine.struts))
        self.engine = Engine(self.plant, rest, load_controller("lhpost6"), panel_numbers(), self.rows)
        start = find_equilibrium(self.plant, parked_pose(machine)) if parked else rest
        self.served = ServedPlant(self.plant, start, LinkMode.REAL_TIME)
        self.n, self.sequence = len(machine.actuators), 0
        self.recording = Recording("test")
        self.reading = self._read(self.served.receive(encode(Datagram(Kind.HELLO, 7)), "here", 0)[-1])
        self.engine.answer(self.reading)

    def _read(self, datagram):
        frame, n = decode(datagram), self.n
        sensors = Feedback(frame.numbers[6 : 6 + n], frame.numbers[:6], frame.numbers[6 + n : 6 + 2 * n])
        return Reading(frame.sequence, frame.state, sensors, frame.acknowledged, frame.stamp, frame.numbers[-MOTION:])

    def do(self, do, program=None, **more):
        self.engine.order({"do": do, **more}, program)

    def step(self, seconds=1.0 / SAMPLE_RATE):
        for _ in range(round(seconds * SAMPLE_RATE)):
            command = self.engine.answer(self.reading)
            self.recording.add(self.engine.row[None].copy())
            if command is not None:
                self.sequence += 1
                counts = self.served._valves
                head = {"actuators": self.n, "valves": int(counts.sum()), "sequence": self.sequence}
                frame = Datagram(Kind.COMMAND, 7, **head, numbers=np.repeat(command, counts))
                self.served.receive(encode(frame), "here", 0)
            if (datagram := self.served.tick(0)) is None:
                return
            self.reading = self._read(datagram)

    def of(self, name):
        return self.rows.of(self.recording.rows(), name)
