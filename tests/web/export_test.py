"""Reads what `dashpot export --mcap` wrote by the specification (mcap.dev/spec): PROGRAM SOURCE_DIRECTORY.

Where the package `mcap` of PyPI is installed, it reads the file as well.
"""
import json
import os
import socket
import struct
import subprocess
import sys
import tempfile

program, source = sys.argv[1:3]
MAGIC = b'\x89MCAP0\r\n'


def records(data):
    """Yields offset, opcode and content of each record."""
    at = 0
    while at < len(data):
        op, size = struct.unpack_from('<BQ', data, at)
        assert at + 9 + size <= len(data), 'a record is cut off'
        yield at, op, data[at + 9:at + 9 + size]
        at += 9 + size


def text(data, at):
    size, = struct.unpack_from('<I', data, at)
    return data[at + 4:at + 4 + size].decode(), at + 4 + size


def check(data, csv):
    assert data.startswith(MAGIC) and data.endswith(MAGIC)
    body = data[8:-8]
    channels, schemas, messages, chunks, indexed = {}, {}, [], {}, 0
    summary_start, = struct.unpack_from('<Q', body, len(body) - 20)
    for at, op, content in records(body):
        if op == 6:
            start, end, size, _ = struct.unpack_from('<QQQI', content)
            compression, after = text(content, 28)
            inner = content[after + 8:]
            assert compression == '' and len(inner) == size
            chunks[at + 8] = (start, end, inner, 9 + len(content))
            last = inner
            for _, kind, record in records(inner):
                if kind == 3:
                    number, = struct.unpack_from('<H', record)
                    name, after = text(record, 2)
                    encoding, after = text(record, after)
                    assert encoding == 'jsonschema'
                    schemas[number] = json.loads(text(record, after)[0])
                    assert schemas[number]['title'] == name
                elif kind == 4:
                    number, schema = struct.unpack_from('<HH', record)
                    channels[number] = (text(record, 4)[0], schema)
                else:
                    assert kind == 5
                    number, _, time, _ = struct.unpack_from('<HIQQ', record)
                    assert start <= time <= end
                    messages.append((channels[number][0], time, json.loads(record[22:])))
                    assert set(messages[-1][2]) == set(schemas[channels[number][1]]['properties'])
        elif op == 7:
            number, size = struct.unpack_from('<HI', content)
            for time, place in struct.iter_unpack('<QQ', content[6:6 + size]):
                kind, _ = struct.unpack_from('<BQ', last, place)
                assert kind == 5 and struct.unpack_from('<HIQ', last, place + 9)[::2] == (number, time)
                indexed += 1
        elif op == 8:
            assert at + 8 > summary_start
            start, end, place, size = struct.unpack_from('<QQQQ', content)
            assert chunks[place][:2] == (start, end) and chunks[place][3] == size
        elif op == 11:
            assert struct.unpack_from('<QHIIII', content) == (
                len(messages), len(schemas), len(channels), 0, 0, len(chunks))
    assert indexed == len(messages) > 1000 and len(chunks) > 1
    modes = [message for topic, _, message in messages if topic == 'DASHPOT_MODES']
    rows = [[message['tick'], label, ratio] for message in modes
            for label, ratio in zip(message['label'], message['damping_ratio'])]
    with open(csv) as file:
        lines = [line.split(',') for line in file.read().splitlines()[1:]]
    assert rows == [[int(line[1]), int(line[2]), float(line[4])] for line in lines]
    return len(messages)


with tempfile.TemporaryDirectory() as folder:
    log, mcap, csv = (os.path.join(folder, name) for name in ('a.lcm', 'a.mcap', 'a.csv'))
    subprocess.run([program, 'run', os.path.join(source, 'sim/scenes/ur5.yaml'), '--fast', '--duration', '1',
                    '--log', log], stdout=subprocess.DEVNULL, check=True)
    subprocess.run([program, 'export', log, '--mcap', mcap, '--csv', csv], check=True)
    with open(mcap, 'rb') as file:
        count = check(file.read(), csv)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:  # as PlotJuggler does
        listener.bind(('127.0.0.1', 0))
        listener.settimeout(20)
        sender = subprocess.Popen([program, 'monitor', '--log', log, '--speed', '2', '--plotjuggler',
                                   str(listener.getsockname()[1])], stdout=subprocess.DEVNULL)
        heard = json.loads(listener.recv(65536))
        assert heard['timestamp'] >= 0 and heard['DASHPOT_STATE']['n'] == 6, heard
        sender.terminate()
        sender.wait()
    try:
        from mcap.reader import make_reader
    except ImportError:
        print('the package mcap is not installed: not read with it')
    else:
        with open(mcap, 'rb') as file:
            assert sum(1 for _ in make_reader(file).iter_messages()) == count
        print(f'{count} messages, read with the package mcap as well')
