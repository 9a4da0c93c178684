"""Measures what the page of `dashpot monitor --web` costs: PROGRAM SOURCE_DIRECTORY [ROUNDS [FRAMES]].

Prints what share of a core Chromium needs for the page of a loop, at rest and while a mode's shape
swings; the tick times of a loop in real time, alone and with two browsers at the page, in turn; and
the memory of the server while it replays a log.
"""
import http.client
import json
import os
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
import browser

program, source = sys.argv[1:3]
rounds, frames = (int(word) for word in (sys.argv[3:] + ['3', '108000'][len(sys.argv) - 3:]))
scene = os.path.join(source, 'sim/scenes/panda.yaml')
url = f'udpm://239.255.76.67:{20000 + os.getpid() % 30000}?ttl=0'


def serve(*options):
    process = subprocess.Popen([program, 'monitor', '--web', '0', '--config', scene, *options],
                               stdout=subprocess.PIPE, text=True)
    return process, process.stdout.readline().split()[0]


def loop(name):
    done = subprocess.run([program, 'run', scene, '--duration', '15', '--lcm-url', url, '--json'],
                          stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    result = json.loads(done.stdout)
    print(f'{name:>14}', *(f'{1e6 * result["tick_time"][key]:8.1f}' for key in
                           ('median', 'p99', 'p99_9', 'longest')),
          f'{result["overruns_by_computing"]:8d}', flush=True)


def with_browsers():
    server, page = serve('--lcm-url', url)
    with browser.Browser() as first, browser.Browser() as second:
        for one in (first, second):
            one.open(page)
        loop('two browsers')
    server.terminate()
    server.wait()


def computing_time(group):
    """CPU time of all processes of a browser, s."""
    ticks = 0
    for process in filter(str.isdigit, os.listdir('/proc')):
        try:
            with open(f'/proc/{process}/stat') as stat:
                words = stat.read().rsplit(')', 1)[1].split()
        except OSError:  # it has ended
            continue
        if int(words[3]) == group:
            ticks += int(words[11]) + int(words[12])
    return ticks / os.sysconf('SC_CLK_TCK')


def page_cost():
    server, page = serve('--lcm-url', url)
    running = subprocess.Popen([program, 'run', scene, '--duration', '120', '--lcm-url', url],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with browser.Browser() as one:
        one.open(page)
        one.until("$$('#chips button').length > 5")
        for name in ('a loop', 'a loop and a mode that swings'):
            time.sleep(10)
            before, then = computing_time(one.process.pid), time.monotonic()
            time.sleep(20)
            share = (computing_time(one.process.pid) - before) / (time.monotonic() - then)
            print(f'the page of {name}: {100 * share:.1f} % of a core', flush=True)
            one.value("$('#chips button').click()")
    for process in (running, server):
        process.terminate()
        process.wait()


def memory():
    with tempfile.TemporaryDirectory() as folder:
        log = os.path.join(folder, 'a.lcm')
        subprocess.run([program, 'run', scene, '--fast', '--duration', '60', '--log', log],
                       stdout=subprocess.DEVNULL, check=True)
        server, page = serve('--log', log)
        connection = http.client.HTTPConnection(page.split('/')[2])
        for i in range(frames + 1):
            connection.request('GET', f'/frame?t={60 * i / frames:.6f}')
            connection.getresponse().read()
            if i % 30 == 0:
                connection.request('GET', f'/response?at=tip/0&t={60 * i / frames:.6f}')
                connection.getresponse().read()
            if i % (frames // 4) == 0:
                with open(f'/proc/{server.pid}/status') as status:
                    size = next(line.split()[1] for line in status if line.startswith('VmRSS'))
                print(f'{i:8d} frames: {int(size) / 1024:.1f} MiB', flush=True)
        server.terminate()
        server.wait()


page_cost()
print('tick, us        median      p99    p99.9  longest  overruns by computing')
for _ in range(rounds):
    loop('alone')
    with_browsers()
memory()
