"""Layouts of the monitor's input: what a file says is what is read, and every mistake in it is told at once."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rthstrack.errors import ConfigurationError, SettingError
from rthstrack.live.layout import (
    Channels,
    Column,
    DatagramLayout,
    Field,
    LineLayout,
    default_layout,
    layout_from,
    read_layout,
)

EVERYTHING = """
byte_order = "big"
header_bytes = 8
sample_bytes = 40
counter = { offset = 4, type = "u32" }
[[actuator]]
name = "north"
unit = "mm"
target = { offset = 8, type = "f32", scale = 25.4, zero = 1.5 }
measured = { offset = 12, type = "i16", scale = -0.01 }
[[actuator]]
target = { offset = 16 }
measured = { offset = 24 }
"""
SIZES = {"f32": 4, "f64": 8, "i16": 2, "u16": 2, "i32": 4, "u32": 4, "i64": 8, "u64": 8}
CODES = {"f32": "f", "f64": "d", "i16": "h", "u16": "H", "i32": "i", "u32": "I", "i64": "q", "u64": "Q"}


def mistakes(table: dict[str, Any], source: Any = "udp") -> dict[str, str]:
    with pytest.raises(ConfigurationError) as caught:
        layout_from(table, source)
    return dict(caught.value.mistakes)


# Right ----------------------------------------------------------------------------------------------------------------


def test_every_key_of_datagrams_is_read(tmp_path: Path) -> None:
    path = tmp_path / "layout.toml"
    path.write_text(EVERYTHING)
    layout = read_layout(path, "udp")
    assert layout == DatagramLayout(
        (
            Channels(Field(8, "f32", 25.4, 1.5), Field(12, "i16", -0.01), "north", "mm"),
            Channels(Field(16), Field(24), "actuator 2"),
        ),
        Field(4, "u32"),
        "big",
        8,
        40,
    )
    assert (layout.n_actuators, layout.names, layout.units) == (2, ("north", "actuator 2"), ("mm", None))
    assert layout.to_dict() == {
        "byte_order": "big",
        "header_bytes": 8,
        "sample_bytes": 40,
        "counter": {"offset": 4, "type": "u32"},
        "target": [
            {"offset": 8, "type": "f32", "scale": 25.4, "zero": 1.5},
            {"offset": 16, "type": "f64", "scale": 1.0, "zero": 0.0},
        ],
        "measured": [
            {"offset": 12, "type": "i16", "scale": -0.01, "zero": 0.0},
            {"offset": 24, "type": "f64", "scale": 1.0, "zero": 0.0},
        ],
    }


def test_the_default_is_little_endian_doubles_counter_target_measured() -> None:
    n = 3
    layout = default_layout("udp", n)
    assert isinstance(layout, DatagramLayout)
    assert (layout.byte_order, layout.header_bytes, layout.sample_bytes) == ("little", 0, 8 * (1 + 2 * n))
    assert layout.counter == Field(0)
    assert [(one.target, one.measured) for one in layout.actuators] == [
        (Field(8 + 16 * i), Field(16 + 16 * i)) for i in range(n)
    ]
    assert default_layout("lines", n).to_dict() == {
        "format": "auto", "delimiter": None, "counter": 0, "target": [1, 3, 5], "measured": [2, 4, 6],
        "scale": [[1.0, 1.0]] * 3,
    }  # fmt: skip


def test_the_compact_form_packs_fields_of_one_type_in_their_order() -> None:
    fields = ["skip", "measured_2", "counter", "target_1", "measured_1", "target_2", "skip"]
    layout = layout_from({"fields": fields, "type": "f32", "unit": "mm", "scale": 2.0}, "udp")
    assert isinstance(layout, DatagramLayout)
    assert layout.sample_bytes == 28
    assert layout.counter == Field(8, "f32")
    assert layout.actuators[0] == Channels(Field(12, "f32", 2.0), Field(16, "f32", 2.0), "actuator 1", "mm")
    assert layout.actuators[1] == Channels(Field(20, "f32", 2.0), Field(4, "f32", 2.0), "actuator 2", "mm")


def test_one_actuator_needs_no_number_and_a_counter_need_not_be() -> None:
    layout = layout_from({"fields": ["target", "measured"]}, "udp")
    assert layout.to_dict()["counter"] is None
    assert layout_from({"counter": False, "actuator": [{"target": 0, "measured": "m"}]}, "lines").counter is None


def test_a_counter_may_be_a_type_alone_and_two_actuators_may_share_a_target() -> None:
    actuator = [
        {"target": {"offset": 4}, "measured": {"offset": 12}},
        {"target": {"offset": 4}, "measured": {"offset": 20}},
    ]
    layout = layout_from({"counter": "i32", "actuator": actuator}, "udp")
    assert isinstance(layout, DatagramLayout)
    assert layout.counter == Field(0, "i32")
    assert layout.sample_bytes == 28


def test_every_key_of_lines_is_read() -> None:
    table = {
        "format": "csv",
        "delimiter": ";",
        "counter": "n",
        "actuator": [
            {"name": "north", "unit": "mm", "target": "xt", "measured": {"column": "xm", "scale": 25.4}},
            {"target": 3, "measured": 4},
        ],
    }
    layout = layout_from(table, "lines")
    assert layout == LineLayout(
        (
            Channels(Column("xt"), Column("xm", 25.4), "north", "mm"),
            Channels(Column(3), Column(4), "actuator 2"),
        ),
        "n",
        "csv",
        ";",
    )
    assert layout.to_dict() == {
        "format": "csv", "delimiter": ";", "counter": "n", "target": ["xt", 3], "measured": ["xm", 4],
        "scale": [[1.0, 25.4], [1.0, 1.0]],
    }  # fmt: skip


# Wrong ----------------------------------------------------------------------------------------------------------------


def test_all_mistakes_of_a_file_are_told_at_once_each_with_its_key(tmp_path: Path) -> None:
    path = tmp_path / "layout.toml"
    path.write_text(
        """
        byte_order = "litle"
        header_bytes = -1
        counter = { offset = 0.5, type = "f46" }
        colour = "red"
        [[actuator]]
        target = { offset = 8, tipe = "f32" }
        measured = { type = "f32", scale = 0 }
        [[actuator]]
        name = ""
        measured = 16
        """
    )
    with pytest.raises(ConfigurationError) as caught:
        read_layout(path, "udp")
    lines = str(caught.value).splitlines()
    assert lines == [
        f"{path}: byte_order: expected one of 'little', 'big', found 'litle' (did you mean 'little'?)",
        f"{path}: header_bytes: expected a whole number from 0 on, found -1",
        f"{path}: counter.offset: expected a whole number from 0 on, found 0.5",
        f"{path}: counter.type: expected one of 'f32', 'f64', 'i16', 'u16', 'i32', 'u32', 'i64', 'u64', found 'f46' "
        "(did you mean 'f64'?)",
        f"{path}: actuator[1].target.tipe: no such key (did you mean 'type'?)",
        f"{path}: actuator[1].measured.offset: missing: expected a whole number from 0 on",
        f"{path}: actuator[1].measured.scale: expected a finite number other than zero, found 0",
        f"{path}: actuator[2].name: expected a text without control characters, found ''",
        f"{path}: actuator[2].target: missing: expected a table",
        f"{path}: actuator[2].measured: expected a table, found 16",
        f"{path}: colour: no such key (did you mean 'counter'?)",
    ]


@pytest.mark.parametrize(
    ("source", "table", "key", "message"),
    [
        ("udp", {}, "counter", "missing"),
        ("udp", {"counter": "f64"}, "actuator", "missing: expected an [[actuator]]"),
        ("udp", {"counter": "f64", "actuator": []}, "actuator", "expected at least one"),
        ("udp", {"counter": "f64", "actuator": {"a": 1}}, "actuator", "expected an array of tables"),
        ("udp", {"counter": True, "actuator": []}, "counter", "false where there is none"),
        ("udp", {"fields": []}, "fields", "expected a list of 'counter', 'target_1'"),
        ("udp", {"fields": ["counter", "skip"]}, "fields", "at least target_1 and measured_1"),
        ("udp", {"fields": ["target_1"]}, "fields", "found no measured_1"),
        ("udp", {"fields": ["target_1", "measured_1", "target_1"]}, "fields", "'target_1' is there twice"),
        ("udp", {"fields": ["target_2", "measured_2"]}, "fields", "numbered from 1 on, found 2"),
        ("udp", {"fields": ["traget_1", "target_1", "measured_1"]}, "fields", "did you mean 'target_1'"),
        ("udp", {"fields": ["target", "measured"], "counter": "f64"}, "counter", "does not go with fields"),
        ("udp", {"fields": ["target", "measured"], "actuator": []}, "actuator", "does not go with fields"),
        ("udp", {"fields": ["target", "measured"], "sample_bytes": 15}, "sample_bytes", "at least the 16 bytes"),
        ("udp", {"fields": ["target", "measured"], "header_bytes": 65500}, "sample_bytes", "no more than the 65507"),
        ("udp", {"fields": ["target", "measured"], "format": "csv"}, "format", "goes with lines"),
        ("udp", {"counter": "f64", "type": "f32"}, "type", "goes with fields"),
        ("lines", {"fields": ["target", "measured"], "byte_order": "big"}, "byte_order", "goes with datagrams"),
        ("lines", {"fields": ["target", "measured"], "delimiter": ",,"}, "delimiter", "expected one character"),
        ("lines", {"fields": ["target", "measured"], "delimiter": "."}, "delimiter", "no part of a number"),
        ("lines", {"fields": ["target", "measured"], "delimiter": ",", "format": "json"}, "delimiter", "goes with CSV"),
        ("lines", {"counter": 0, "actuator": [{"target": 0, "measured": 1}]}, "actuator[1].target", "the counter's"),
        ("lines", {"counter": 0, "actuator": [{"target": 1, "measured": 1}]}, "actuator[1].measured", "the target's"),
        ("lines", {"counter": 0, "actuator": [{"target": -1, "measured": 1}]}, "actuator[1].target", "or its number"),
    ],
)  # fmt: skip
def test_a_mistake_names_its_key(source: str, table: dict[str, Any], key: str, message: str) -> None:
    found = mistakes(table, source)
    assert message in found[key]


def test_fields_that_share_bytes_are_a_mistake() -> None:
    table = {"counter": "f64", "actuator": [{"target": {"offset": 4}, "measured": {"offset": 16}}]}
    assert mistakes(table) == {"actuator[1].target": "bytes 4 to 11 overlap with counter, bytes 0 to 7"}


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=3)
            | st.dictionaries(
                st.sampled_from(
                    ["counter", "fields", "actuator", "target", "measured", "offset", "type", "scale", "column"]
                ),
                inner,
                max_size=4,
            )
        ),
        max_leaves=12,
    ),
    st.sampled_from(["udp", "lines"]),
)
def test_whatever_the_table_it_is_a_layout_or_told_mistakes(value: Any, source: Any) -> None:
    table = value if isinstance(value, dict) else {"counter": value, "actuator": value}
    try:
        layout: object = layout_from(table, source)
    except ConfigurationError as error:
        layout = error
    if isinstance(layout, ConfigurationError):
        assert layout.mistakes
        assert all(line.strip() for line in str(layout).splitlines())


# Encoding -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("kind", SIZES)
def test_what_is_encoded_is_what_the_layout_says(kind: str, order: Any) -> None:
    size = SIZES[kind]
    layout = DatagramLayout(
        (Channels(Field(size, kind, 0.5, 10), Field(2 * size, kind), "a"),), Field(0, kind), order, 0, 3 * size + 1
    )
    target, measured = np.array([[1.0], [2.5]]), np.array([[3.0], [4.0]])
    encoded = layout.encoded(np.array([7, 8]), target, measured)
    code = f"{'<' if order == 'little' else '>'}3{CODES[kind]}x"
    assert [struct.unpack(code, row.tobytes()) for row in encoded] == [(7, 12, 3), (8, 15, 4)]


def test_a_counter_begins_again_where_its_type_ends() -> None:
    counter = np.array([65535, 65536, (1 << 24) - 1, 1 << 24])
    zeros = np.zeros((4, 1))
    for kind, expected in (("u16", [65535, 0, 65535, 0]), ("f32", [65535, 65536, (1 << 24) - 1, 0])):
        layout = layout_from({"fields": ["counter", "target", "measured"], "type": kind}, "udp")
        assert isinstance(layout, DatagramLayout)
        rows = layout.encoded(counter, zeros, zeros)
        assert [struct.unpack("<" + CODES[kind], row[: SIZES[kind]].tobytes())[0] for row in rows] == expected


def test_values_that_a_type_does_not_hold_are_told() -> None:
    layout = layout_from({"fields": ["target", "measured"], "type": "i16"}, "udp")
    assert isinstance(layout, DatagramLayout)
    layout.check_range("target", 0, np.array([-32768.0, 32767.0]))
    with pytest.raises(
        SettingError, match=r"target of actuator 1 cannot be sent as i16.* comes to 32768; expected -32768"
    ):
        layout.check_range("target", 0, np.array([0.0, 32768.0]))
    with pytest.raises(SettingError, match="NaN or infinite"):
        layout.check_range("measured", 0, np.array([0.0, np.nan]))
    double = default_layout("udp")
    assert isinstance(double, DatagramLayout)
    double.check_range("measured", 0, np.array([0.0, np.nan, 1e300]))


@pytest.mark.parametrize("text", ["north\x1b[2J", "a\nb", "\u202emm", "\x9b31m"])
def test_a_name_or_unit_that_would_command_a_terminal_is_refused(text: str) -> None:
    actuator = {"target": {"offset": 8}, "measured": {"offset": 16}}
    for key in ("name", "unit"):
        found = mistakes({"counter": "f64", "actuator": [actuator | {key: text}]})
        assert found[f"actuator[1].{key}"].startswith("expected a text without control characters")
    assert "actuator[1].target" in mistakes({"counter": 0, "actuator": [{"target": text, "measured": 2}]}, "lines")


def test_names_and_units_of_any_language_are_taken() -> None:
    actuator = {"target": {"offset": 8}, "measured": {"offset": 16}, "name": "Zylinder Süd", "unit": "kN\u202fm"}
    layout = layout_from({"counter": "f64", "actuator": [actuator]}, "udp")
    assert (layout.names, layout.units) == (("Zylinder Süd",), ("kN\u202fm",))
