"""Drives headless Chromium by its DevTools protocol over pipes, with the standard library alone."""
import json
import os
import select
import shutil
import signal
import subprocess
import tempfile
import time


def find():
    """Returns the path of Chromium, or None."""
    return shutil.which('chromium') or shutil.which('chromium-browser')


HANG = 1200  # s, longer than a busy machine takes for anything


class Browser:
    """A Chromium of its own with one page."""

    def __init__(self, width=1400, height=1000, scale=1, mobile=False):
        self.folder = tempfile.mkdtemp(prefix='dashpot-browser-')
        to_read, self.to = os.pipe()
        self.back, to_write = os.pipe()

        def wire():  # Chromium reads from 3 and writes to 4
            a, b = os.dup2(to_read, 100), os.dup2(to_write, 101)
            os.dup2(a, 3)
            os.dup2(b, 4)

        self.process = subprocess.Popen(
            [find(), '--headless', '--no-sandbox', '--disable-gpu', '--remote-debugging-pipe',
             '--disable-background-networking', '--no-first-run', '--disable-dev-shm-usage',
             f'--user-data-dir={self.folder}', 'about:blank'],
            preexec_fn=wire, close_fds=False, start_new_session=True, stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_write)
        self.buffer = b''
        self.number = 0
        self.events = []
        self.session = None
        target = self.call('Target.createTarget', url='about:blank')['targetId']
        self.session = self.call('Target.attachToTarget', targetId=target, flatten=True)['sessionId']
        for domain in ('Runtime', 'Page', 'Log', 'Network'):
            self.call(f'{domain}.enable')
        self.call('Emulation.setScrollbarsHidden', hidden=True)
        self.size(width, height, scale, mobile)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        try:
            os.killpg(self.process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        self.process.wait()
        os.close(self.to)
        os.close(self.back)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _message(self, end):
        while b'\0' not in self.buffer:
            ready, _, _ = select.select([self.back], [], [], max(0, end - time.monotonic()))
            part = os.read(self.back, 1 << 16) if ready else b''
            if not part:
                raise RuntimeError('Chromium does not answer' if not ready else 'Chromium has ended')
            self.buffer += part
        text, self.buffer = self.buffer.split(b'\0', 1)
        return json.loads(text)

    def call(self, method, **params):
        self.number += 1
        message = {'id': self.number, 'method': method, 'params': params}
        if self.session:
            message['sessionId'] = self.session
        os.write(self.to, json.dumps(message).encode() + b'\0')
        end = time.monotonic() + HANG
        while True:
            answer = self._message(end)
            if answer.get('id') == self.number:
                if 'error' in answer:
                    raise RuntimeError(f'{method}: {answer["error"]}')
                return answer['result']
            self.events.append(answer)

    def size(self, width, height, scale=1, mobile=False):
        self.call('Emulation.setDeviceMetricsOverride', width=width, height=height,
                  deviceScaleFactor=scale, mobile=mobile)

    def open(self, url):
        self.call('Page.navigate', url=url)

    def value(self, expression):
        """Returns the JSON value of a JavaScript expression, which may be a promise. $ finds an element, $$ a list."""
        answer = self.call('Runtime.evaluate', expression=expression, returnByValue=True, awaitPromise=True,
                           includeCommandLineAPI=True)
        if 'exceptionDetails' in answer:
            raise RuntimeError(str(answer['exceptionDetails']))
        return answer['result'].get('value')

    def until(self, expression, seconds=HANG):
        """Waits until an expression is true; raises RuntimeError if it does not become so."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            found = self.value(expression)
            if found:
                return found
            time.sleep(0.05)
        raise RuntimeError(f'does not become true: {expression}; '
                           + str(self.value('JSON.stringify(window.dashpot?.errors)')))

    @staticmethod
    def eventually(check, seconds=HANG):
        """Returns what `check` returns as soon as it raises no AssertionError."""
        end = time.monotonic() + seconds
        while True:
            try:
                return check()
            except AssertionError:
                if time.monotonic() > end:
                    raise
            time.sleep(0.05)

    def errors(self):
        """Returns what went wrong on the page: exceptions, errors in the log, refused resources.

        A connection that the server ends does not count.
        """
        found = list(self.value('window.dashpot ? window.dashpot.errors : []'))
        for event in self.events:
            params = event.get('params', {})
            if event.get('method') == 'Runtime.exceptionThrown':
                found.append(str(params['exceptionDetails']))
            if event.get('method') == 'Log.entryAdded' and params['entry']['level'] == 'error':
                text = params['entry']['text'] + ' ' + params['entry'].get('url', '')
                if 'ERR_' not in text:
                    found.append(text)
        return found

    def requests(self):
        """Returns the addresses that the page has asked for."""
        return [event['params']['request']['url'] for event in self.events
                if event.get('method') == 'Network.requestWillBeSent']
