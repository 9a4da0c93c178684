"""Walks through the task of the paper's Discussion on the page of `dashpot tune`: PROGRAM SOURCE_DIRECTORY FOLDER.

Prints the ratios on the way, and writes the pictures tune.png, tune-1.png and tune-2.png of the documents to the
folder.
"""
import base64
import os
import signal
import subprocess
import sys

sys.dont_write_bytecode = True
import browser

CURRENT = 'window.dashpot && dashpot.ready && dashpot.current && !dashpot.problem.a && !dashpot.problem.b'


def ratios(page):
    return page.value('dashpot.answers.a.modes.map((mode) => mode.damping_ratio)')


def begin(page):
    """Gives both designs the paper's stiffness, and design A the damping C_C0 = I."""
    page.value("""dashpot.store.edit((state) => { state.edited = "a"; state.a.damping = [1, 1, 1, 1, 1, 1];
        for (const one of ["a", "b"]) state[one].stiffness = [3000, 3000, 3000, 100, 100, 100];
        state.b.damping = {ratio: 0.7}; }, true)""")
    page.until(CURRENT)


def propose(page):
    """Clicks "Propose a diagonal" for design A."""
    page.value("$$('#gains button').find((b) => b.textContent == 'Propose a diagonal').click()")
    page.until('dashpot.store.state.a.damping[0] != 1 && ' + CURRENT)


def picture(page, path, first, last, scale):
    """Writes what is between the upper left end of one element and the lower right end of another."""
    box = page.value(f'''(() => {{
        const [a, b] = ['{first}', '{last}'].map((id) => $('#' + id).getBoundingClientRect());
        return {{x: a.left + scrollX, y: a.top + scrollY, width: b.right - a.left, height: b.bottom - a.top}}; }})()''')
    data = page.call('Page.captureScreenshot', format='png', captureBeyondViewport=True,
                     clip=box | {'scale': scale})['data']
    with open(path, 'wb') as file:
        file.write(base64.b64decode(data))


def main(program, source, folder):
    process = subprocess.Popen([program, 'tune', '--port', '0'], stdout=subprocess.PIPE, text=True, cwd=source)
    try:
        with browser.Browser(1400, 1000) as page:
            page.open(process.stdout.readline().split()[0] + '?theme=light')
            page.until(CURRENT)
            begin(page)
            for number, what in enumerate(('C_C0 = I', 'proposed'), 1):
                print(f'{what:8s}:', ' '.join(f'{ratio:.3f}' for ratio in ratios(page)))
                picture(page, os.path.join(folder, f'tune-{number}.png'), 'poles', 'poles', 0.6)
                if number == 1:
                    propose(page)
            page.until('dashpot.workspace.found.b.postures >= 2000')
            page.value('new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))')
            picture(page, os.path.join(folder, 'tune.png'), 'arm_panel', 'table_panel', 0.55)
            for row in page.value('dashpot.answers.a.system.task_damping'):
                print('  ', ' '.join(f'{x:7.2f}' for x in row))
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()
        process.stdout.close()


if __name__ == '__main__':
    main(*sys.argv[1:4])
