"""What the page says of loops in trouble, and how it is read: PROGRAM SOURCE_DIRECTORY. Exit status 77: skipped."""
import math
import os
import re
import struct
import subprocess
import sys
import time

sys.dont_write_bytecode = True
from page_site import FOLDER, PROGRAM, SOURCE, PageTest, Site, main, run, write

JOINTS = 16


def chain():
    """A chain of sixteen joints, which has sixteen modes."""
    links, axes = '<link name="l0"/>', ('0 0 1', '0 1 0', '1 0 0')
    for i in range(JOINTS):
        mass = 2.5 - 0.13 * i
        links += (f'<link name="l{i + 1}"><inertial><mass value="{mass}"/><origin xyz="0 0 0.06"/><inertia '
                  f'ixx="{0.01 * mass}" iyy="{0.01 * mass}" izz="{0.004 * mass}" ixy="0" ixz="0" iyz="0"/>'
                  '</inertial></link>'
                  f'<joint name="hinge_{i + 1}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
                  f'<origin xyz="0 0 0.12"/><axis xyz="{axes[i % 3]}"/><limit lower="-3" upper="3" effort="200" '
                  'velocity="5"/><dynamics damping="0" friction="0"/></joint>')
    write('chain.urdf', f'<robot name="chain">{links}</robot>')
    return write('chain.yaml', f'''
robot: {{urdf: chain.urdf, base: l0, tip: l{JOINTS}}}
gains: {{joint: {{stiffness: {[300 + 40 * i for i in range(JOINTS)]}, damping_ratio: 0.3}}}}
scenario: {{duration: 5 s, start: {{position: {[round(0.3 * (-1) ** (i // 2), 2) for i in range(JOINTS)]}}}}}
''')


def delayed(log, after, by):
    """A copy of a log whose messages after so many s come `by` s later."""
    with open(log, 'rb') as file:
        data = file.read()
    at, first, out = 0, None, bytearray()
    while at < len(data):
        sync, number, utime, channel, size = struct.unpack_from('>IqqII', data, at)
        first = utime if first is None else first
        moved = utime + int(by * 1e6) * (utime - first > after * 1e6)
        out += struct.pack('>IqqII', sync, number, moved, channel, size) + data[at + 28:at + 28 + channel + size]
        at += 28 + channel + size
    path = os.path.join(FOLDER, 'delayed.lcm')
    with open(path, 'wb') as file:
        file.write(out)
    return path


class States(PageTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.scene = chain()
        cls.log = os.path.join(FOLDER, 'chain.lcm')
        run('run', cls.scene, '--fast', '--duration', '1', '--log', cls.log)

    def replay(self, log, scene, t, query=''):
        site = Site('--log', log, '--config', scene)
        self.open(site, query)
        self.seek(t)
        return site

    def seek(self, t):
        self.browser.value(f'dashpot.seek({t})')
        self.browser.until(f"$('#time_text').textContent == '{t:.2f} s'")

    def text(self, selector):
        return self.browser.value(f'$({selector!r}).innerText')

    def hidden(self, name):
        return self.browser.value(f"$('#{name}').hidden")

    def test_a_loop_that_ends_is_shown_as_silent_and_then_as_gone(self):
        url = f'udpm://239.255.76.67:{20000 + os.getpid() % 30000}?ttl=0'
        scene = os.path.join(SOURCE, 'sim/scenes/panda_release_ratio_damping.yaml')
        site = Site('--lcm-url', url, '--config', scene)
        loop = subprocess.Popen([PROGRAM, 'run', scene, '--duration', '10000', '--lcm-url', url],
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            self.browser.open(site.url)
            try:
                self.browser.until('window.dashpot && dashpot.frame && dashpot.frame.messages > 0', 60)
            except RuntimeError:
                self.skipTest('multicast does not work on this machine')
            self.browser.until("$('#link').className == 'badge good'")
            self.assertEqual((self.hidden('silence'), self.hidden('fault')), (True, True))
            self.assertFalse(self.browser.value("$('main').classList.contains('gone')"))
            # Paused, the page shows one time while messages come.
            self.browser.value("$('#pause').click()")
            shown = self.browser.value('[dashpot.frame.messages, dashpot.latest.messages]')
            self.browser.until(f'dashpot.latest.messages > {shown[1]} + 10')
            self.assertEqual(self.browser.value('dashpot.frame.messages'), shown[0])
            self.browser.value("$('#pause').click()")
            self.assertGreater(self.browser.value('dashpot.frame.messages'), shown[1])
            loop.terminate()
            loop.wait()
            self.browser.until("/silent for \\d+ s/.test($('#link')?.textContent)")
            self.assertFalse(self.hidden('silence'))
            self.assertIn('--lcm-url', self.text('#silence'))
            self.assertTrue(self.browser.value("$('main').classList.contains('gone')"))
            self.assertEqual(self.browser.value("$$('header .good').length"), 0)
            self.browser.value('location.reload()')  # a page that comes later knows the age as well
            self.browser.until('window.dashpot && dashpot.frame && dashpot.frame.age > 2')
            self.browser.until("/silent for \\d+ s/.test($('#link')?.textContent)")
            site.stop()
            self.browser.until("$('#silence')?.innerText.includes('No connection')")
            self.assertTrue(self.browser.value("$('main').classList.contains('gone')"))
        finally:
            loop.terminate()
            loop.wait()
            site.stop()

    def test_a_gap_in_a_log_is_told(self):
        site = self.replay(delayed(self.log, 0.5, 20), self.scene, 10)
        self.browser.until("$('#silence').textContent.includes('No message for 9 s')")
        self.seek(0.25)
        self.browser.until("$('#silence').hidden")
        site.stop()

    def test_a_fault_comes_with_advice_and_a_link(self):
        scene = os.path.join(SOURCE, 'sim/scenes/safety/velocity_sign.yaml')
        log = os.path.join(FOLDER, 'fault.lcm')
        subprocess.run([PROGRAM, 'run', scene, '--fast', '--log', log], stdout=subprocess.DEVNULL,
                       stderr=subprocess.DEVNULL)
        site = self.replay(log, scene, 3)
        self.browser.until("!$('#fault').hidden")
        self.assertIn('Check units, signs and order of the joints', self.text('#fault'))
        self.assertIn('## Faults', self.browser.value(
            "fetch($('#fault a').href).then((answer) => answer.text())"))
        # Every fault that can latch has advice of its own.
        with open(os.path.join(SOURCE, 'controller/base/tick_status.cpp')) as file:
            texts = re.findall(r'case Status::k(\w+):\s+return "([^"]*)"', file.read())
        faults = [text for name, text in texts[[name for name, _ in texts].index('FaultLatched') + 1:]]
        self.assertEqual(len(faults), 17)
        said = [self.browser.value(f"import('/monitor/notices.js').then((m) => m.faultAdvice({text!r}))")
                for text in faults]
        self.assertEqual(len(set(said)), 17)
        self.assertNotIn(self.browser.value("import('/monitor/notices.js').then((m) => m.faultAdvice('?'))"), said)
        self.seek(0.5)
        self.browser.until("$('#fault').hidden")
        site.stop()

    def marks(self):
        return self.browser.value('''Object.fromEntries($$('#chips button').map((chip) =>
            [chip.dataset.label, $('svg', chip).style.color + $('path', chip).getAttribute('d')]))''')

    def test_sixteen_modes_look_different_and_stay_so(self):
        site = self.replay(self.log, self.scene, 0.75)
        self.browser.until("$$('#chips button').length == 16")
        marks = self.marks()
        self.assertEqual(len(set(marks.values())), JOINTS)
        dashed = self.browser.value('''$$('#legend svg').map((svg) =>
            svg.style.color + svg.querySelector('path').getAttribute('stroke-dasharray'))''')
        self.assertEqual(len(set(dashed)), JOINTS)
        self.open(site, '?theme=dark')  # another theme, another time: the same marks
        self.seek(0.9)
        self.browser.until("$$('#chips button').length == 16")
        self.assertEqual(self.marks(), marks)
        # Shapes as the terminal has them.
        said = run('monitor', '--log', self.log)
        rows = re.findall(r'^ *(\d+) .*?  (q\d+.*?)(?: \.\.\.)?$', said[said.index('Modes at the end'):], re.M)
        self.assertEqual(len(rows), JOINTS)
        self.seek(1)
        self.browser.until("$$('#rows tr').length == 16")

        def as_in_the_terminal():
            shown = dict(self.browser.value(
                "$$('#rows tr').map((r) => [r.cells[0].innerText.trim(), r.cells[6].textContent])"))
            for label, shape in rows:
                page = shown[label].replace('−', '-').replace('°', ' deg').replace(' …', '')
                self.assertTrue(page.startswith(shape) or shape.startswith(page), (shape, page))
        self.browser.eventually(as_in_the_terminal)
        self.assertEqual(self.text('#joints tr:nth-child(16)').split()[:2], ['q16', 'hinge_16'])
        site.stop()

    def test_the_wanted_ratio_decides_what_is_green(self):
        site = self.replay(self.log, self.scene, 0.75)
        self.browser.until("$$('#rows tr').length == 16")
        kinds = self.browser.value("$$('#rows tr').map((r) => r.cells[3].className)")
        self.assertEqual(kinds, ['good'] * JOINTS)
        judged = self.browser.value('''import('/monitor/tables.js').then((m) => [m.judge(0.69, 0.7), m.judge(0.6, 0.7),
            m.judge(0.6, 0), m.judge(-0.1, 0), m.judge(null, 0.7)])''')
        self.assertEqual(judged, ['good', 'bad', '', 'bad', 'none'])
        site.stop()
        scene = os.path.join(SOURCE, 'sim/scenes/panda_release_c1.yaml')  # damping given as numbers
        log = os.path.join(FOLDER, 'c1.lcm')
        run('run', scene, '--fast', '--duration', '0.5', '--log', log)
        site = self.replay(log, scene, 0.4)
        self.browser.until("$$('#rows tr').length >= 6")
        self.assertEqual(self.browser.value("$$('#rows .good, #rows .bad').length"), 0)
        site.stop()

    def test_other_joints_are_said_once(self):
        site = self.replay(self.log, os.path.join(SOURCE, 'sim/scenes/ur5.yaml'), 0.75)
        self.browser.until("$('#arm').getAttribute('aria-label').startsWith('other joints: the loop has 16')")
        time.sleep(1.5)  # whatever would say it later
        self.assertNotIn('other joints', self.text('body'))
        labels = self.browser.value("$$('canvas').map((c) => c.getAttribute('aria-label'))")
        self.assertEqual(sum('other joints' in label for label in labels if label), 1)
        self.assertIsNone(self.browser.value('dashpot.response'))
        site.stop()

    def test_curves_zoom_and_tell_values(self):
        site = self.replay(self.log, self.scene, 0.75)
        self.browser.until("$('#frequency').getAttribute('aria-label')?.includes('mode 16')")
        event = '''((type, x, more) => { const c = $('#frequency'), box = c.getBoundingClientRect();
            const kind = {keydown: KeyboardEvent, wheel: WheelEvent}[type] || PointerEvent;
            c.dispatchEvent(new kind(type,
            {clientX: box.left + x, clientY: box.top + 50, bubbles: true, cancelable: true, ...more})); })'''
        width = self.browser.value("$('#frequency').clientWidth")
        self.browser.value(f"{event}('pointermove', {width / 2})")
        self.browser.until("$$('.hint:not([hidden]) div').length == 17")
        told = self.text('.hint').replace('−', '-').split('\n')
        at = float(told[0].split()[0])
        self.assertAlmostEqual(at, (width / 2 - 54) / (width - 66), places=2)
        fastest = self.browser.value(f'''fetch('/frame?t={at}').then((f) => f.json())
            .then((f) => Math.max(...f.modes.natural_frequency))''')
        self.assertLess(abs(float(told[1].split()[-1]) / fastest - 1), 0.01)
        self.browser.value(f"{event}('wheel', {width / 2}, {{deltaY: -500}})")  # scrolls the page
        self.assertIsNone(self.browser.value('dashpot.times.shown'))
        self.browser.value("$('#frequency').focus()")
        self.browser.value(f"{event}('wheel', {width / 2}, {{deltaY: -500}})")
        shown = self.browser.value('dashpot.times.shown')
        self.assertAlmostEqual(shown[1] - shown[0], math.exp(-1), places=3)
        self.assertTrue(shown[0] < at < shown[1])
        self.browser.value(f"{event}('keydown', 0, {{key: 'ArrowLeft'}})")
        self.assertLess(self.browser.value('dashpot.times.shown[0]'), shown[0])
        self.browser.value(f"{event}('keydown', 0, {{key: '0'}})")
        self.assertIsNone(self.browser.value('dashpot.times.shown'))
        self.browser.value("$('#zoom_in').click()")
        self.assertIsNotNone(self.browser.value('dashpot.times.shown'))
        self.browser.value(f"{event}('pointerleave', 0)")
        self.browser.until("$('.hint').hidden")
        # Ticks of a logarithmic axis.
        ticks = "import('/shared/axes.js').then((m) => m.logTicks({}))"
        self.assertEqual(self.browser.value(ticks.format('0.5, 200, 12')), [.5, 1, 2, 5, 10, 20, 50, 100, 200])
        self.assertEqual(self.browser.value(ticks.format('1e-6, 1e6, 6')), [10 ** e for e in range(-6, 7, 2)])
        self.assertGreaterEqual(len(self.browser.value(ticks.format('9.7, 10.9, 4'))), 3)
        site.stop()

    def test_a_wall_is_shown_with_the_force_of_the_contact(self):
        scene = os.path.join(SOURCE, 'sim/scenes/safety/table.yaml')
        log = os.path.join(FOLDER, 'table.lcm')
        run('run', scene, '--fast', '--duration', '3', '--log', log)
        site = self.replay(log, scene, 2.5)
        self.browser.until("$('#arm').getAttribute('aria-label').includes('contact')")

        def pressed_in():
            label, z = self.browser.value("[$('#arm').getAttribute('aria-label'), dashpot.frame.state.tip_position[2]]")
            depth, newton = (float(x) for x in re.search(r'pressed in by ([\d.]+) mm, contact ([\d.]+) N',
                                                         label).groups())
            self.assertAlmostEqual(depth, 1e3 * (0.4559 - z), delta=0.01)
            self.assertAlmostEqual(newton, 2e4 * (0.4559 - z), delta=1)
        self.browser.eventually(pressed_in)
        site.stop()

    def drawings(self, seconds):
        """How often the canvas of the arm and all canvases are drawn in so long."""
        self.browser.value('''(() => { const old = CanvasRenderingContext2D.prototype.clearRect; window.drawn = {};
            CanvasRenderingContext2D.prototype.clearRect = function (...a) {
            drawn[this.canvas.id] = (drawn[this.canvas.id] || 0) + 1;
            return old.apply(this, a); }; })()''')
        time.sleep(seconds)
        return self.browser.value('drawn')

    def test_draws_only_what_changes_and_heeds_who_wants_no_motion(self):
        site = self.replay(self.log, self.scene, 0.75)
        self.browser.until('dashpot.response')
        def still():
            self.assertEqual(self.drawings(2), {})
        self.browser.eventually(still)
        self.browser.value("$('#chips button').click()")
        self.browser.eventually(  # the shape swings
            lambda: self.assertEqual(list(self.drawings(2)), ['arm']))
        self.browser.call('Emulation.setEmulatedMedia',
                          features=[{'name': 'prefers-reduced-motion', 'value': 'reduce'}])
        try:
            self.browser.eventually(still)
            self.assertIn('mode', self.browser.value("$('#arm').getAttribute('aria-label')"))
        finally:
            self.browser.call('Emulation.setEmulatedMedia', features=[])
        site.stop()

    def test_says_what_each_part_is(self):
        site = self.replay(self.log, self.scene, 0.75)
        self.browser.until('dashpot.response')
        unnamed = self.browser.value('''$$('canvas, section, button, input, select, table').filter((e) =>
            !e.hidden && !(e.ariaLabel || e.getAttribute('aria-labelledby') || e.innerText || e.closest('label')))
            .map((e) => e.id)''')
        self.assertEqual(unnamed, [])
        roles = self.browser.value("['fault', 'silence', 'link', 'arm', 'frequency'].map((id) => $('#' + id).role)")
        self.assertEqual(roles, ['alert', 'status', 'status', 'img', 'img'])
        site.stop()


if __name__ == '__main__':
    main()
