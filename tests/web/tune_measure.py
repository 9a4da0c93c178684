"""Measures how fast the page of `dashpot tune` answers: PROGRAM SOURCE_DIRECTORY [MOVES].

From the event of a slider to the frame that has both designs' numbers, in headless Chromium; the
three numbers of 2000 postures, by the program alone, in time and in processor time, and on the page;
and the load of the machine.
"""
import http.client
import json
import os
import signal
import subprocess
import sys
import time

sys.dont_write_bytecode = True
import browser
import tune_walk

program, source = sys.argv[1:3]
moves = int(sys.argv[3]) if len(sys.argv) > 3 else 60

MOVE = '''(async () => { const out = [];
  for (let i = 0; i < %d; ++i) {
    const one = document.querySelector('%s');
    dashpot.timing.length = 0;
    one.value = Number(one.value) + (i %% 2 ? 3 : -3);
    one.dispatchEvent(new Event('input', {bubbles: true}));
    const began = performance.now();
    while (!dashpot.timing.length && performance.now() - began < 5000) await new Promise((done) => setTimeout(done, 1));
    out.push(dashpot.timing[0]);
    await new Promise((done) => setTimeout(done, 40));
  }
  return out.sort((a, b) => a - b); })()'''


def processor_time():
    """Of the program, ms."""
    with open(f'/proc/{process.pid}/stat') as stat:
        fields = stat.read().rsplit(')', 1)[1].split()
    return 1e3 * (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def postures(host, setup, design):
    connection = http.client.HTTPConnection(host)
    began = time.perf_counter()
    for part in range(20):
        connection.request('POST', '/workspace',
                           json.dumps({'design': design, 'seed': 1, 'first': 100 * part, 'count': 100}),
                           {'Content-Type': 'application/json', 'X-Dashpot-Token': setup['token']})
        connection.getresponse().read()
    return 1e3 * (time.perf_counter() - began)


process = subprocess.Popen([program, 'tune', '--port', '0'], stdout=subprocess.PIPE, text=True, cwd=source)
try:
    url = process.stdout.readline().split()[0]
    print('processes that want to run:', ' '.join(f'{load:.1f}' for load in os.getloadavg()),
          f'on {os.cpu_count()} cores')
    connection = http.client.HTTPConnection(url.split('/')[2])
    connection.request('GET', '/setup')
    setup = json.loads(connection.getresponse().read())
    base = setup['designs'][1]
    for name, design in (('factor 2', base | {'damping': {'factor': 2}}), ('ratio 0.7', base)):
        before = processor_time()
        fastest = min(postures(url.split('/')[2], setup, design) for _ in range(5))
        each = (processor_time() - before) / 5
        print(f'2000 postures, {name}: {fastest:.0f} ms, fastest of 5, and {each:.0f} ms of processors')
    connection = http.client.HTTPConnection(url.split('/')[2])
    before = processor_time()
    for _ in range(50):
        connection.request('POST', '/design', json.dumps({'q': setup['q'], 'place': 'tip/0', 'design': base}),
                           {'Content-Type': 'application/json', 'X-Dashpot-Token': setup['token']})
        connection.getresponse().read()
    print(f'a posture in full, ratio 0.7: {(processor_time() - before) / 50:.1f} ms of processors')
    with browser.Browser(1400, 1000) as page:
        page.open(url)
        page.until(tune_walk.CURRENT)
        page.value('dashpot.store.edit((state) => { state.a.damping = {factor: 2}; }, true)')
        page.until('dashpot.workspace.found.a.postures >= 2000 && dashpot.workspace.found.b.postures >= 2000')
        print('on the page: ' + ', '.join(f'{name} {page.value(f"dashpot.workspace.found.{key}.took"):.0f} ms' for key,
                                          name in (('a', 'factor 2'), ('b', 'ratio 0.7'))))
        for name, slider in (('posture', '#posture input[type=range]'), ('stiffness', '#gains input[type=range]')):
            found = page.value(MOVE % (moves, slider))
            least, median, most = found[0], found[len(found) // 2], found[int(.9 * len(found))]
            print(f'slider of {name}: {least:.0f} ms at least, {median:.0f} ms median, {most:.0f} ms at 90 %')
finally:
    process.send_signal(signal.SIGINT)
    process.wait()
    process.stdout.close()
