"""What a browser shows of `dashpot monitor --web`: PROGRAM SOURCE_DIRECTORY. Exit status 77: skipped."""
import math
import os
import subprocess
import sys

sys.dont_write_bytecode = True
from page_site import FOLDER, PROGRAM, SOURCE, PageTest, Site, main, run, write

# Two gains, one after the other, on one joint whose inertia is 0.5 kg m^2: a closed form.
URDF = '''<robot name="flywheel"><link name="base"/><link name="wheel"><inertial><mass value="1"/>
<origin xyz="0 0 0"/><inertia ixx="0.5" iyy="0.5" izz="0.5" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="axle" type="revolute"><parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="50" velocity="20"/><dynamics damping="0" friction="0"/></joint></robot>'''
LIVE_SCENE = '''
robot: {urdf: wheel.urdf, base: base, tip: wheel}
gains: {joint: {stiffness: [50], damping: [4]}}
scenario:
  duration: 10000 s
  start: {position: [0.3]}
'''
SCENE = LIVE_SCENE + '''  steps:
    - {at: 3 s, gains: {joint: {stiffness: [200], damping: [4]}}}
'''
INERTIA = 0.5


def poles(stiffness, damping):
    decay = damping / (2 * INERTIA)
    return -decay, math.sqrt(stiffness / INERTIA - decay ** 2)


FINITE_POLES = 'dashpot.poles.length && dashpot.poles'


class Page(PageTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        write('wheel.urdf', URDF)
        cls.scene = write('wheel.yaml', SCENE)
        cls.live_scene = write('live.yaml', LIVE_SCENE)
        cls.log = os.path.join(FOLDER, 'wheel.lcm')
        run('run', cls.scene, '--fast', '--duration', '6', '--log', cls.log)

    def await_poles(self, re, im):
        def drawn():
            found = sorted(self.browser.value(FINITE_POLES), key=lambda pole: pole['im'])
            self.assertEqual(len(found), 2)
            for pole, sign in zip(found, (-1, 1)):
                self.assertAlmostEqual(pole['re'], re, places=6)
                self.assertAlmostEqual(pole['im'], sign * im, places=6)
            return found
        return self.browser.eventually(drawn)

    def await_frequency(self, re, im):
        """The cells of the table, once it shows the natural frequency of this pole."""
        def shown():
            cells = self.browser.value(
                "$$('#rows td').map((c) => c.textContent)")
            self.assertEqual(float(cells[1]), float(f'{math.hypot(re, im):.4g}'))
            return cells
        return self.browser.eventually(shown)

    def test_draws_a_known_pole_where_it_belongs(self):
        site = Site('--log', self.log, '--config', self.scene)
        self.open(site)
        self.browser.value('dashpot.seek(2)')
        self.browser.until('dashpot.frame.utime > 1990000 && dashpot.frame.utime < 2010000 && '
                           'dashpot.poles.length == 2')
        re, im = poles(50, 4)
        found = self.await_poles(re, im)
        # On the canvas: on the ray of its ratio, and painted.
        origin = self.browser.value('dashpot.origin')
        for pole in found:
            x, y = pole['x'] - origin[0], origin[1] - pole['y']
            self.assertAlmostEqual(-x / math.hypot(x, y), -re / math.hypot(re, im), places=6)
            self.assertEqual(y > 0, pole['im'] > 0)
            if y < 0:
                continue  # the lower half is not drawn
            pixel = self.browser.value(f'''(() => {{ const c = $('#poles');
                const s = c.width / c.clientWidth; return [...c.getContext('2d').getImageData(
                {pole['x']} * s, {pole['y']} * s, 1, 1).data]; }})()''')
            self.assertEqual(pixel, [0x00, 0x72, 0xb2, 255])
        cells = self.await_frequency(re, im)
        self.assertEqual(float(cells[3]), round(-re / math.hypot(re, im), 3))
        # The response, as the one-line formula has it.
        self.browser.value("($('#place').value = 'joint/0', "
                           "$('#place').dispatchEvent(new Event('change')))")
        self.browser.until("dashpot.response && dashpot.response.unit == 'rad/(N m)'")
        self.browser.until("dashpot.response.magnitude[0] > 0.0199")
        response = self.browser.value('dashpot.response')
        for omega, size in list(zip(response['omega'], response['magnitude']))[::40]:
            exact = 1 / abs(complex(50 - INERTIA * omega ** 2, 4 * omega))
            self.assertAlmostEqual(size / exact, 1, places=6)
        self.assertTrue(all(url.startswith(site.url) for url in self.browser.requests()
                            if url.startswith('http')))
        site.stop()

    def test_replays_a_log_to_the_same_final_numbers(self):
        site = Site('--log', self.log)
        self.open(site)
        for _ in range(5):
            self.browser.value("$('#faster').click()")
        self.browser.until("$('#play').textContent == 'Play'")
        self.browser.until(f'dashpot.frame.modes.tick == {self.last_tick()}')
        re, im = poles(200, 4)
        self.await_poles(re, im)
        self.await_frequency(re, im)
        said = run('monitor', '--log', self.log)
        self.assertIn(f'{math.hypot(re, im):.4g}', said)
        for t, stiffness in (1, 50), (5, 200):  # what the curve tells under the pointer
            self.browser.value(f'''(() => {{ const c = $('#frequency'), box = c.getBoundingClientRect();
                const clientX = box.left + 54 + (c.clientWidth - 66) * {t} / 6, clientY = box.top + 50;
                c.dispatchEvent(new PointerEvent('pointermove', {{clientX, clientY}})); }})()''')
            told = f'{math.sqrt(stiffness / INERTIA):.2f}'
            self.browser.until(f"$('.hint')?.innerText.includes('mode 1: {told}')")
        self.browser.value('dashpot.seek(1)')  # and back in time
        re, im = poles(50, 4)
        self.browser.until(f'dashpot.poles.length == 2 && Math.abs(Math.abs(dashpot.poles[0].im) - {im}) < 1e-6')
        site.stop()

    def last_tick(self):
        csv = os.path.join(FOLDER, 'modes.csv')
        run('export', self.log, '--csv', csv)
        with open(csv) as file:
            return int(file.read().split('\n')[-2].split(',')[1])

    def test_follows_a_change_of_gains_and_survives_a_restart(self):
        url = f'udpm://239.255.76.67:{20000 + os.getpid() % 30000}?ttl=0'
        site = Site('--lcm-url', url, '--config', self.live_scene)
        self.browser.open(site.url)
        self.browser.until("$('#link')?.textContent.includes('connected')")
        self.browser.until("$('#link')?.textContent.includes('waiting')")
        loop = subprocess.Popen([PROGRAM, 'run', self.live_scene, '--commands', '--lcm-url', url],
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            try:
                self.browser.until('dashpot.frame && dashpot.frame.messages > 0', 60)
            except RuntimeError:
                self.skipTest('multicast does not work on this machine')
            for stiffness in (50, 200):
                run('command', '--joint-stiffness', str(stiffness), '--joint-damping', '4', '--lcm-url', url,
                    '--timeout', '600')
                re, im = poles(stiffness, 4)
                self.browser.until(f'dashpot.poles.length == 2 && '
                                   f'Math.abs(Math.abs(dashpot.poles[0].im) - {im}) < 1e-6')
                self.await_poles(re, im)
            self.browser.until("$('#response_note').textContent.includes('others')")
            site.stop()
            self.browser.until("$('#link')?.textContent.includes('lost') || "
                               "$('#link')?.textContent.includes('no connection')")
            site.start()
            before = self.browser.value('dashpot.frames')
            self.browser.until("$('#link')?.textContent == 'connected' && "
                               f'dashpot.frames > {before + 30}')
            self.await_poles(re, im)
        finally:
            loop.terminate()
            loop.wait()
            site.stop()

    def test_draws_every_arm_that_it_may_get(self):
        for name in ('panda', 'ur5'):
            scene = os.path.join(SOURCE, 'sim/scenes', name + '.yaml')
            log = os.path.join(FOLDER, name + '.lcm')
            run('run', scene, '--fast', '--duration', '0.2', '--log', log)
            site = Site('--log', log, '--config', scene)
            self.open(site)
            self.browser.value('dashpot.seek(0.1)')
            # The page's kinematics and the program's agree on the tip.
            self.browser.until('dashpot.frame.utime == 100000 && dashpot.tip && dashpot.frame.state.tip_position'
                               '.every((x, k) => Math.abs(x - dashpot.tip[k][3]) < 1e-9)')
            self.assertGreaterEqual(self.browser.value("$$('#chips button').length"), 6)
            self.browser.value("$$('#chips button')[0].click()")
            self.browser.until("$('#chips button').getAttribute('aria-pressed') == 'true'")
            self.browser.size(390, 800, 2, True)
            self.assertLessEqual(self.browser.value('document.documentElement.scrollWidth'), 390)
            self.browser.size(1400, 1000)
            site.stop()


if __name__ == '__main__':
    main()
