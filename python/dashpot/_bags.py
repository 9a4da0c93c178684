"""Logs of ROS 2 and MCAP files as arrays."""

from __future__ import annotations

import collections
import functools
import importlib
import json
import os
import pathlib
import warnings
from collections.abc import Iterator, Sequence
from typing import Any, Callable

import numpy as np
import numpy.typing as npt

from ._core import Error

Columns = dict[str, npt.NDArray[Any]]
_MCAP, _SQLITE = b"\x89MCAP0\r\n", b"SQLite format 3\0"


def is_bag(path: str) -> bool:
    """Whether the path is a rosbag2 (a folder or one of its files) or an MCAP file."""
    if os.path.isdir(path):
        return True
    try:
        with open(path, "rb") as file:
            head = file.read(16)
    except OSError:
        return False
    return head.startswith(_MCAP) or head == _SQLITE or head.startswith(b"#ROSBAG")


def _flatten(value: Any, prefix: str, fields: dict[str, Any]) -> None:
    """Adds numbers, texts and lists of these under their dotted names."""
    if hasattr(value, "__dataclass_fields__"):
        value = {name: getattr(value, name) for name in value.__dataclass_fields__
                 if not name.startswith("__")}
    if not isinstance(value, dict):
        fields[prefix] = value
        return
    for name, item in value.items():
        _flatten(item, f"{prefix}.{name}" if prefix else name, fields)


def _column(values: list[Any]) -> npt.NDArray[Any] | None:
    """One field of all messages, padded with NaN where sizes differ; None if it is neither numbers
    nor texts."""
    if any(isinstance(value, str) for value in values):
        return np.array([value if isinstance(value, str) else "" for value in values], dtype=np.str_)
    try:
        arrays = [np.asarray(np.nan if value is None else value) for value in values]
    except ValueError:  # of uneven lists
        return None
    if any(array.dtype.kind not in "bif" and not (array.dtype.kind == "u") and array.size > 0
           for array in arrays):
        return None
    depth = max(array.ndim for array in arrays)
    if all(array.shape == arrays[0].shape for array in arrays):
        stacked: npt.NDArray[Any] = np.stack(arrays)
        return stacked
    if any(array.ndim != depth and array.size > 0 and array.ndim > 0 for array in arrays):
        return None
    shape = [max((array.shape[i] for array in arrays if array.ndim == depth), default=0)
             for i in range(depth)]
    result = np.full((len(arrays), *shape), np.nan)
    for row, array in zip(result, arrays):
        if array.ndim == depth:
            row[tuple(slice(n) for n in array.shape)] = array
    return result


def _joint_states(rows: list[dict[str, Any]]) -> Columns:
    """Columns of JointState by the names of joints: messages may have them in any order."""
    places: dict[str, int] = {}
    for row in rows:
        for name in row["name"]:
            places.setdefault(name, len(places))
    result: Columns = {"name": np.array(list(places), dtype=np.str_)}
    for field in ("position", "velocity", "effort"):
        values = np.full((len(rows), len(places)), np.nan)
        for i, row in enumerate(rows):
            numbers = np.asarray(row[field], float)
            if len(numbers) == len(row["name"]):
                values[i, [places[name] for name in row["name"]]] = numbers
        result[field] = values
    return result


class _Topics:
    """Collects messages."""

    def __init__(self) -> None:
        self.rows: dict[str, list[dict[str, Any]]] = collections.defaultdict(list)
        self.times: dict[str, list[int]] = collections.defaultdict(list)
        self.types: dict[str, str] = {}
        self.failed: dict[str, tuple[int, str]] = {}

    def add(self, topic: str, kind: str, time: int, decode: Callable[[], Any]) -> None:
        try:
            fields: dict[str, Any] = {}
            _flatten(decode(), "", fields)
        except Exception as error:  # any kind, for bytes of other programs
            count, _ = self.failed.get(topic, (0, ""))
            self.failed[topic] = (count + 1, " ".join(str(error).split())[:200])
            return
        self.types[topic] = kind
        self.rows[topic].append(fields)
        self.times[topic].append(time)

    def columns(self, topic: str) -> Columns:
        rows = self.rows[topic]
        result: Columns = {}
        if self.types[topic].rpartition("/")[2] == "JointState" and "name" in rows[0]:
            result = _joint_states(rows)
        names = dict.fromkeys(name for row in rows for name in row)
        for name in names:
            if name not in result:
                column = _column([row.get(name) for row in rows])
                if column is not None:
                    result[name] = column
        if "header.stamp.sec" in result:
            result["time"] = (result["header.stamp.sec"].astype(float)
                              + 1e-9 * result["header.stamp.nanosec"].astype(float))
        result["log_utime"] = np.array(self.times[topic], dtype=np.int64) // 1000
        return result


def _decoder(store: Any, known: set[str], kind: str, encoding: str, schema: Any) -> (
        Callable[[bytes], Any]):
    if encoding == "json":
        return json.loads
    if encoding != "cdr":
        raise ValueError(f"messages encoded as {encoding or 'nothing'} are not read")
    if kind not in known and schema is not None and schema.encoding == "ros2msg":
        types = importlib.import_module("rosbags.typesys").get_types_from_msg(schema.data.decode(), kind)
        store.register({name: fields for name, fields in types.items()
                        if name not in store.fielddefs})
        known.add(kind)
    return lambda data: store.deserialize_cdr(data, kind)


def _ros_name(name: str) -> str:
    """package/msg/Type of package/Type, too."""
    parts = name.split("/")
    return "/".join([parts[0], "msg", parts[1]]) if len(parts) == 2 else name


def _read_mcap(path: str, wanted: Callable[[str, str], bool], topics: _Topics) -> None:
    try:
        make_reader = importlib.import_module("mcap.reader").make_reader
    except ImportError:
        raise Error(f"{path}: is MCAP: pip install mcap, which reads it") from None
    store, known = None, set[str]()
    decoders: dict[int, Callable[[bytes], Any]] = {}

    def decode(name: str, schema: Any, channel: Any, data: bytes) -> Any:
        nonlocal store
        if channel.id not in decoders:
            if channel.message_encoding == "cdr" and store is None:
                store = _typestore(path)
                known.update(store.fielddefs)
            decoders[channel.id] = _decoder(store, known, _ros_name(name), channel.message_encoding, schema)
        return decoders[channel.id](data)

    with open(path, "rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            name = schema.name if schema is not None else ""
            if wanted(channel.topic, name):
                topics.add(channel.topic, name, message.log_time,
                           functools.partial(decode, name, schema, channel, message.data))


def _typestore(path: str) -> Any:
    try:
        typesys = importlib.import_module("rosbags.typesys")
    except ImportError:
        raise Error(f"{path}: has messages of ROS: pip install rosbags, which reads them") from None
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)


def _read_rosbag(path: str, wanted: Callable[[str, str], bool], topics: _Topics) -> None:
    store = _typestore(path)
    bags = importlib.import_module("rosbags.highlevel")
    with bags.AnyReader([pathlib.Path(path)], default_typestore=store) as reader:
        chosen = [connection for connection in reader.connections
                  if wanted(connection.topic, connection.msgtype)]
        messages: Iterator[Any] = reader.messages(chosen) if chosen else iter(())
        for connection, time, data in messages:
            topics.add(connection.topic, connection.msgtype, time,
                       functools.partial(reader.deserialize, data, connection.msgtype))


def read_bag(path: str, topics: Sequence[str] | None, types: Sequence[str] | None) -> (
        dict[str, Columns]):
    """Returns the topics, all or with these names or message types, as read_log does."""
    def wanted(topic: str, kind: str) -> bool:
        if topics is None and types is None:
            return True
        return topic in (topics or ()) or any(
            kind == name or _ros_name(kind) == _ros_name(name) or kind.rpartition("/")[2] == name
            for name in types or ())

    collected = _Topics()
    try:
        mcap = os.path.isfile(path) and open(path, "rb").read(8) == _MCAP
        (_read_mcap if mcap else _read_rosbag)(path, wanted, collected)
    except Error:
        raise
    except Exception as error:  # of the packages that read it
        text = " ".join(str(error).split()) or type(error).__name__
        if not collected.rows:
            raise Error(f"{path}: {text}") from None
        warnings.warn(f"{path}: {text}; the part before it was read", stacklevel=3)
    for topic, (count, text) in collected.failed.items():
        warnings.warn(f"{path}: {topic}: {count} messages are not read: {text}", stacklevel=3)
    return {topic: collected.columns(topic) for topic in collected.rows}
