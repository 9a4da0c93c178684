"""What tests of the page share: files in a folder of their own, and servers. PROGRAM SOURCE_DIRECTORY."""
import atexit
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest

import browser

PROGRAM, SOURCE = sys.argv[1:3]
FOLDER = tempfile.mkdtemp(prefix='dashpot-page-')
atexit.register(shutil.rmtree, FOLDER, True)


def write(name, text):
    path = os.path.join(FOLDER, name)
    with open(path, 'w') as file:
        file.write(text)
    return path


def run(*words):
    done = subprocess.run([PROGRAM, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


class Site:
    """A server that can be restarted at its port."""

    def __init__(self, *options, port=0):
        self.options, self.port, self.process = options, port, None
        self.start()
        atexit.register(self.stop)

    def start(self):
        self.process = subprocess.Popen([PROGRAM, 'monitor', '--web', str(self.port), *self.options],
                                        stdout=subprocess.PIPE, text=True)
        self.url = self.process.stdout.readline().split()[0]
        self.port = int(self.url.rstrip('/').split(':')[-1])

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        if self.process.wait() != 0:
            raise RuntimeError(f'the monitor ended with status {self.process.returncode}')
        self.process.stdout.close()


class PageTest(unittest.TestCase):
    """Has a browser, on whose page nothing may go wrong."""
    @classmethod
    def setUpClass(cls):
        cls.browser = browser.Browser()
        cls.browser.__enter__()

    @classmethod
    def tearDownClass(cls):
        cls.browser.__exit__()

    def tearDown(self):
        self.assertEqual(self.browser.errors(), [])
        self.browser.open('about:blank')
        self.browser.events.clear()

    def open(self, site, query=''):
        self.browser.open(site.url + query)
        self.browser.until('window.dashpot && dashpot.frame && dashpot.frame.messages > 0')


def main():
    if browser.find() is None:
        print('skipped: no Chromium on this machine (apt-get install chromium)')
        sys.exit(77)
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
