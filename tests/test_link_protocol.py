"""The link's datagrams: what the table of the layout says, byte by byte, and nothing else."""

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lhpost6_pin.core.errors import LhpostError, LinkError, UnknownNameError
from lhpost6_pin.interfaces.link.protocol import (
    Datagram,
    Kind,
    LinkMode,
    PlantState,
    ShortDatagramError,
    Welcome,
    decode,
    encode,
    find_mode,
    is_newer,
    refusal,
)

U32, U64 = st.integers(0, 2**32 - 1), st.integers(0, 2**64 - 1)
FINITE = st.floats(allow_nan=False, allow_infinity=False)
HEAD = {"mode": st.sampled_from(LinkMode), "state": st.sampled_from(PlantState), "stamp": U64, "echo": U64}
HEAD |= dict.fromkeys(("session", "sequence", "acknowledged"), U32)
ABOUT = Welcome(2048.0, "lhpost6", ("H1", "V1", "Längs"), (2, 1, 1))
EXAMPLES = [
    Datagram(Kind.HELLO, 7),
    Datagram(Kind.WELCOME, 7, LinkMode.FREE, actuators=3, valves=4, welcome=ABOUT),
    Datagram(Kind.COMMAND, 7, actuators=2, valves=3, sequence=1, numbers=np.array([0.5, -0.25, 1e-300])),
    Datagram(Kind.SENSORS, 7, LinkMode.REAL_TIME, PlantState.HOLD, 1, 1, 9, 8, 5, 6, np.arange(26.0)),
    Datagram(Kind.BYE, 7),
    Datagram(Kind.STATUS, 7, counts=tuple(range(12))),
    Datagram(Kind.SWITCH, 7, fault="entrained_air@H1", on=True),
    Datagram(Kind.HELLO, 7, pressures=True),
    Datagram(Kind.SENSORS, 7, actuators=2, numbers=np.arange(38.0), pressures=True, struts=3),
]
"""One frame of each kind, and those that ask for pressures and carry them."""


def same(a: Datagram, b: Datagram) -> bool:
    numbers = [x.tobytes() if x is not None else b"" for x in (a.numbers, b.numbers)]
    return a._replace(numbers=None) == b._replace(numbers=None) and numbers[0] == numbers[1]


def test_a_command_written_by_hand_from_the_layout_is_a_frame():
    datagram = bytearray(48 + 2 * 8)
    datagram[0:4] = b"LHP6"
    datagram[4], datagram[5], datagram[8], datagram[9] = 2, 3, 2, 2
    for offset, form, value in ((12, "<I", 77), (16, "<I", 1), (24, "<Q", 10**18), (48, "<d", 0.5), (56, "<d", -0.25)):
        struct.pack_into(form, datagram, offset, value)
    frame = decode(bytes(datagram))
    wanted = Datagram(Kind.COMMAND, 77, actuators=2, valves=2, sequence=1, stamp=10**18, numbers=np.array([0.5, -0.25]))
    assert same(frame, wanted)
    datagram[10] = 1  # flags: a CRC is there
    struct.pack_into("<I", datagram, 40, zlib.crc32(datagram))
    assert bytes(datagram) == encode(wanted)


def test_sensors_and_welcome_are_laid_out_as_the_table_says():
    sensors = encode(EXAMPLES[3])
    assert sensors[6] == 1 and sensors[7] == 2
    assert struct.unpack_from("<IIQQ", sensors, 16) == (9, 8, 5, 6)
    assert struct.unpack_from("<26d", sensors, 48) == tuple(range(26))
    welcome = encode(EXAMPLES[1])
    assert struct.unpack_from("<d32s", welcome, 48) == (2048.0, b"lhpost6".ljust(32, b"\0"))
    assert struct.unpack_from("<15sB15sB", welcome, 88) == (b"H1".ljust(15, b"\0"), 2, b"V1".ljust(15, b"\0"), 1)


@given(st.fixed_dictionaries(HEAD), st.lists(FINITE, max_size=30))
def test_commands_and_sensors_come_back_to_the_last_bit(head, numbers):
    command = Datagram(Kind.COMMAND, **head, valves=len(numbers), numbers=np.array(numbers, float))
    assert same(decode(encode(command)), command)
    n = len(numbers) // 2
    sensors = Datagram(Kind.SENSORS, **head, actuators=n, numbers=np.array([*range(24), *numbers[: 2 * n]], float))
    assert same(decode(encode(sensors)), sensors)


def test_a_command_with_a_wrench_sets_its_flag_and_has_six_numbers_more():
    values = np.array([0.5, -0.25, *range(1, 7)], float)
    datagram = encode(Datagram(Kind.COMMAND, 7, actuators=2, valves=2, sequence=1, numbers=values))
    assert datagram[10] == 3 and len(datagram) == 48 + 8 * 8
    assert struct.unpack_from("<6d", datagram, 64) == (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    found = decode(datagram)
    assert np.array_equal(found.wrench, values[2:]) and np.array_equal(found.numbers, values)
    assert decode(encode(EXAMPLES[2])).wrench is None and EXAMPLES[3].wrench is None
    with pytest.raises(LinkError, match="command frame of 2 actuators"):
        encode(Datagram(Kind.COMMAND, 7, actuators=2, valves=2, numbers=values[:7]))


def test_sensors_with_pressures_are_laid_out_as_the_table_says_and_others_as_before():
    """Bit 2 of flags and k in its upper byte; after the motion of the interface 3 n + k + 1 numbers."""
    asked, given, plain = (encode(EXAMPLES[k]) for k in (7, 8, 3))
    assert struct.unpack_from("<H", asked, 10) == (0b101,) and len(asked) == 48
    assert struct.unpack_from("<H", given, 10) == (3 << 8 | 0b101,) and len(given) == 48 + 8 * (6 + 4 + 18 + 6 + 3 + 1)
    assert struct.unpack_from("<38d", given, 48) == tuple(range(38))
    assert struct.unpack_from("<H", plain, 10) == (1,) and len(plain) == 48 + 8 * 26
    with pytest.raises(LinkError, match="sensors frame of 2 actuators"):
        encode(EXAMPLES[8]._replace(struts=2))


def test_a_switch_written_by_hand_from_the_layout_is_a_frame():
    datagram = bytearray(48 + 40)
    datagram[0:6] = b"LHP6\x02\x07"
    datagram[48:64], datagram[87] = b"entrained_air@H1", 1
    frame = decode(bytes(datagram))
    assert (frame.kind, frame.fault, frame.on) == (Kind.SWITCH, "entrained_air@H1", True)
    datagram[87] = 2
    with pytest.raises(LinkError, match="switched to 2"):
        decode(bytes(datagram))
    longest = Datagram(Kind.SWITCH, 0, fault="é" * 19 + "a")
    assert decode(encode(longest)).fault == longest.fault
    with pytest.raises(LinkError, match="at most 39 bytes"):  # cut, it might be the name of another
        encode(longest._replace(fault="é" * 20))


def test_a_client_of_version_1_is_told_in_frames_of_its_own_which_version_is_needed():
    """Decoded by the layout of version 1: a machine without actuators whose name is the message."""
    welcome, sensors = refusal(77)
    for datagram, kind in ((welcome, 2), (sensors, 4)):
        assert (datagram[4], datagram[5], datagram[8], datagram[9]) == (1, kind, 0, 0)
        assert struct.unpack_from("<I", datagram, 12) == (77,)
        blank = bytearray(datagram)
        blank[40:44] = bytes(4)
        assert struct.unpack_from("<I", datagram, 40) == (zlib.crc32(blank),)
    assert len(welcome) == 48 + 40 and len(sensors) == 48 + 48
    assert struct.unpack_from("<d32s", welcome, 48)[1].rstrip(b"\0") == b"needs protocol version 2"


def test_names_too_long_for_their_place_are_cut_to_whole_characters():
    about = Welcome(2048.0, "m" * 40, ("a" * 14 + "é",), (1,))
    found = decode(encode(Datagram(Kind.WELCOME, 0, actuators=1, valves=1, welcome=about))).welcome
    assert found.machine == "m" * 32 and found.actuators == ("a" * 14,)


@given(st.binary(max_size=400))
def test_any_bytes_are_a_frame_or_refused(datagram):
    with pytest.raises(LhpostError):  # nobody guesses a CRC of a frame's length
        decode(datagram)


@given(st.sampled_from(EXAMPLES), st.data())
def test_bytes_after_a_right_beginning_are_a_frame_or_refused(frame, data):
    good = bytearray(encode(frame))
    good[10] = 0  # no CRC, so that changes reach what lies behind it
    good[40:44] = bytes(4)
    for at, value in data.draw(st.lists(st.tuples(st.integers(4, len(good) - 1), st.integers(0, 255)), max_size=8)):
        good[at] = value
    try:
        found = decode(bytes(good))
    except LinkError:
        return
    assert found.numbers is None or np.isfinite(found.numbers).all()


@pytest.mark.parametrize("frame", EXAMPLES, ids=lambda f: f.kind.name + "_with_pressures" * f.pressures)
def test_a_frame_comes_back_cut_short_is_short_and_too_long_or_with_a_changed_bit_is_refused(frame):
    datagram = encode(frame)
    assert same(decode(datagram), frame)
    for size in range(len(datagram)):
        with pytest.raises(ShortDatagramError):
            decode(datagram[:size])
    with pytest.raises(LinkError, match="too many"):
        decode(datagram + b"\0")
    for bit in range(8 * len(datagram)):
        changed = bytearray(datagram)
        changed[bit // 8] ^= 1 << bit % 8
        with pytest.raises(LinkError):
            decode(bytes(changed))


@pytest.mark.parametrize(
    "offset, value, word", [(0, 65, "begins"), (4, 1, "version 1; version 2 is needed"), (5, 8, "kind 8"), (5, 0, "0")]
)
def test_what_is_wrong_with_a_header_is_said(offset, value, word):
    datagram = bytearray(encode(EXAMPLES[0]))
    datagram[offset] = value
    with pytest.raises(LinkError, match=word):
        decode(bytes(datagram))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_or_do_not_fit_the_counts_are_neither_sent_nor_taken(value):
    frame = EXAMPLES[2]._replace(numbers=np.array([0.0, value, 0.0]))
    with pytest.raises(LinkError, match="number 2"):
        encode(frame)
    datagram = bytearray(encode(EXAMPLES[2]))
    datagram[10], datagram[40:44] = 0, bytes(4)
    struct.pack_into("<d", datagram, 56, value)
    with pytest.raises(LinkError, match="number 2"):
        decode(bytes(datagram))
    with pytest.raises(LinkError, match="command frame of 2 actuators and 4 valves"):
        encode(EXAMPLES[2]._replace(valves=4))


@given(U32, st.integers(1, 2**31 - 1))
def test_sequence_numbers_go_on_past_the_largest(sequence, ahead):
    later = (sequence + ahead) % 2**32
    assert is_newer(later, sequence) and not is_newer(sequence, later) and not is_newer(sequence, sequence)


def test_modes_are_found_by_name_and_a_wrong_one_is_told_the_valid_ones():
    assert [find_mode(m.label) for m in LinkMode] == list(LinkMode)
    with pytest.raises(UnknownNameError, match="free, lock-step, real-time"):
        find_mode("realtime")
