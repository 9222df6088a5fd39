"""Signals, forks and imports, each in a process of its own."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest


def python(code: str, **options):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False, **options)


SCENE = """
import kinetoscope as ks
sim = ks.SimulationManager(num_envs=64, threads={threads})
arm = sim.add_robot(ks.bundled_robot("sr5"))
"""


# Calls that take minutes, and what is true after they were interrupted.
LONG_CALLS = {
    "update": ("sim.update(10_000_000)", "sim.time[0] > 0"),
    "update_for": ("sim.update_for(100_000.0)", "sim.time[0] > 0"),
    # The simulation does not change, and one row has more steps than a block.
    "rollout": ("sim.rollout(np.zeros((1, 200_000, 6)))", "sim.time[0] == 0"),
    "verify_recording": ("replayed.verify_recording('run.npz')", "replayed.time[0] > 0"),
    "step": ("task.step(np.zeros((64, 6)))", "not stepped() and task.reset()[0].shape == (64, 6)"),
    "play": ("ks.Playback('short.npz', sim).play()", "sim.time[0] == 0"),
    # Targets out of reach use all starts.
    "compute_ik": ("chain.compute_ik(far)", "chain.compute_ik(far[0], {'num_seeds': 1}).success.tolist() == [False]"),
}
PREPARED = {
    "verify_recording": (
        "one = {'num_envs': 1, 'threads': 1, 'ground': None}\n"
        "def simulation():\n    own = ks.SimulationManager(one)\n    own.add_robot(ks.bundled_robot('sr5'))\n    return own\n"
        "recorded, replayed = simulation(), simulation()\n"
        "with recorded.record('run.npz'):\n    recorded.update(60_000)\n"
    ),
    "step": (
        "place = {'place': {'type': 'joint_pos_rel'}}\n"
        "task = ks.Task(sim, {'decimation': 1_000_000, 'observations': {'policy': place}, 'rewards': {'alive': {'type': 'is_alive', 'weight': 1.0}},\n"
        "    'actions': {'push': {'type': 'joint_positions', 'robot': 'sr5', 'joints': ['.*']}}})\n"
        "task.reset()\n"
        "def stepped():\n"
        "    try:\n        return task.step(np.zeros((64, 6)))\n"
        "    except ks.ArgumentError as error:\n        assert 'reset' in str(error)\n"
    ),
    "compute_ik": "chain = ks.KinematicChain(ks.bundled_robot('sr5'), 'ee_link')\nfar = np.tile([9.0, 0, 0, 1, 0, 0, 0], (10_000, 1))\n",
    "play": "with ks.SimulationManager(threads=1) as short:\n    short.add_rigid_object(uid='a')\n    with short.record('short.npz'):\n        short.update(500)\nsim = ks.SimulationManager(threads=1)\nsim.add_rigid_object(uid='a')\n",
}


def assert_interrupted(code, folder, after):
    """Runs a program that prints ``ready``, sends Ctrl+C after some seconds [s], and expects its line: ``interrupted``, the time
    of the exception, True."""
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=folder)
    try:
        assert process.stdout.readline() == "ready\n"
        time.sleep(after)
        sent = time.time()
        process.send_signal(signal.SIGINT)
        words = process.communicate(timeout=60)[0].split()
    finally:
        process.kill()
    assert words[0] == "interrupted" and words[2] == "True"
    assert float(words[1]) - sent < 0.2


@pytest.mark.parametrize("name", LONG_CALLS)
def test_ctrl_c_ends_long_calls(name, tmp_path):
    call, after = LONG_CALLS[name]
    code = SCENE.format(threads=2) + "import time\nimport numpy as np\n" + PREPARED.get(name, "") + (
        "print('ready', flush=True)\n"
        f"try:\n    {call}\nexcept KeyboardInterrupt:\n    late = time.time()\n    print('interrupted', late, {after})\n"
    )
    assert_interrupted(code, tmp_path, after=1.0)


# Calls that wait for a simulation that another thread uses.
WAITING_CALLS = {
    "update": "sim.update(1)",
    "qpos": "arm.qpos",
    "write": "arm.set_qpos_target(np.zeros(6))",
    "rollout": "sim.rollout(np.zeros((1, 10, 6)))",
    "verify_recording": "sim.verify_recording('run.npz')",
    "task": "ks.Task(sim, {})",
    "destroy": "sim.destroy()",
}


@pytest.mark.parametrize("name", WAITING_CALLS)
def test_ctrl_c_ends_the_wait_for_another_thread(name, tmp_path):
    """The other thread goes on: it computes for seconds, and the call would wait as long."""
    code = SCENE.format(threads=2) + (
        "import os, threading, time\nimport numpy as np\n"
        "thread = threading.Thread(target=sim.rollout, args=(np.zeros((64, 40_000, 6)),), daemon=True)\nthread.start()\n"
        "time.sleep(0.5)\nprint('ready', flush=True)\n"
        f"try:\n    {WAITING_CALLS[name]}\nexcept KeyboardInterrupt:\n"
        "    print('interrupted', time.time(), thread.is_alive() and 'in use' in repr(sim), flush=True)\nos._exit(0)\n"
    )
    assert_interrupted(code, tmp_path, after=0.5)


def test_times_of_a_playback_that_another_thread_plays(tmp_path):
    """Reading them waits for nothing. ``seek`` needs the simulation, and Ctrl+C ends its wait."""
    code = (
        # A read that waits ends the process, which the test sees as a missing line.
        "import os, signal, threading, time\nimport kinetoscope as ks\nsignal.alarm(30)\n" + PREPARED["play"] + "playback = ks.Playback('short.npz', sim)\n"
        "before = list(playback.times), [playback.frame_at(time) for time in (-1.0, 0.1, 99.0)]\n"
        "thread = threading.Thread(target=playback.play, daemon=True)\nthread.start()\ntime.sleep(0.5)\n"
        "for _ in range(100):\n"
        "    after = list(playback.times), [playback.frame_at(time) for time in (-1.0, 0.1, 99.0)]\n"
        "    assert after == before and len(playback) == len(before[0]) == 501 and '501' in repr(playback)\n"
        "assert before[1] == [0, 10, 500] and thread.is_alive() and playback.joints_without_data == []\n"
        "print('ready', flush=True)\n"
        "try:\n    playback.seek(3)\nexcept KeyboardInterrupt:\n"
        "    print('interrupted', time.time(), thread.is_alive(), flush=True)\nos._exit(0)\n"
    )
    assert_interrupted(code, tmp_path, after=0.5)


def test_python_handlers_run_during_update():
    """A handler may use the simulation: no lock is held while it runs."""
    code = SCENE.format(threads=2) + (
        "import signal\nseen = []\n"
        "signal.signal(signal.SIGALRM, lambda *_: seen.append(sim.time[0]))\n"
        "signal.setitimer(signal.ITIMER_REAL, 0.3)\n"
        "while not seen:\n    sim.update(2000)\n"
        "print(len(seen))\n"
    )
    assert python(code).stdout == "1\n"


FORK = """
import os, signal
pid = os.fork()
if pid == 0:
    signal.alarm(30)
    try:
        sim.update(3)
        arm.qpos
        code = 3
    except ks.ForkError as error:
        assert "spawn" in str(error)
        code = 4
    except BaseException as error:
        print(repr(error), flush=True)
        code = 5
    if code == 4:
        # A simulation of the child's own works, and the parent's can be dropped.
        own = ks.SimulationManager(num_envs=4, threads=2)
        own.add_rigid_object(uid="cube")
        own.update(5)
        del sim, arm
        del own
    os._exit(code)
status = os.waitpid(pid, 0)[1]
sim.update(3)
print(os.waitstatus_to_exitcode(status), sim.time[0])
"""


@pytest.mark.parametrize(("threads", "code"), [(2, "4"), (1, "3")])
def test_fork(threads, code):
    result = python(SCENE.format(threads=threads) + "sim.update(1)\n" + FORK)
    assert result.stdout.split() == [code, "0.04"], result.stdout + result.stderr


@pytest.mark.parametrize("start", ["keep = sim.record('file.npz')", "keep = sim.serve()", "keep = sim.show()", "keep = sim.viewer()"])
@pytest.mark.parametrize("act", ["sim.update(500)", "sim.destroy()", "del sim, arm, keep"])
def test_fork_with_threads_of_recordings_and_viewers(start, act, tmp_path):
    """threads=1 starts no workers, but recordings and viewers have threads, which the child does not have."""
    code = SCENE.format(threads=1) + f"{start}\n" + (
        "import os, signal\nsim.update(2)\npid = os.fork()\n"
        "if pid == 0:\n    signal.alarm(20)\n    code = 3\n"
        f"    try:\n        {act}\n"
        "    except ks.ForkError:\n        code = 4\n"
        "    except BaseException as error:\n        print(repr(error), flush=True)\n        code = 5\n"
        "    os._exit(code)\n"
        "print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))\n"
    )
    result = python(code, cwd=tmp_path)
    assert result.stdout == ("3\n" if act.startswith("del") else "4\n"), result.stdout + result.stderr


# Objects with threads, and arguments of their methods.
THREADED = {
    "sim.open_window()": {},
    "ks.ImageWindow()": {"show": "np.zeros((2, 2, 3), np.uint8)", "__exit__": ""},
    "sim.viewer()": {
        "set_speed": "1.0", "seek": "0.0", "set_target": "arm, 0, 0.0", "drag": "'sr5/link1', [0, 0, 0]", "__exit__": "",
    },  # fmt: skip
    "sim.record('file.npz')": {"note": "'text'", "__exit__": ""},
    "sim.serve()": {},
}
# Members that only return a value that the object has.
WITHOUT_THREADS = {"Recorder": {"path"}, "Server": {"url", "viewers"}}


@pytest.mark.parametrize("start", THREADED)
def test_fork_with_objects_that_have_threads(start, tmp_path, display):
    """Every member of such an object raises in the child, and none waits for a thread that does not exist. In the parent, the
    object is as before."""
    code = SCENE.format(threads=1) + (
        f"import os, signal\nimport numpy as np\nkeep = {start}\nsim.update(2)\narguments = {THREADED[start]!r}\n"
        "names = [name for name in dir(type(keep)) if not name.startswith('_')] + [name for name in arguments if name[0] == '_']\n"
        "def act(name):\n"
        "    value = getattr(keep, name)\n"
        "    return value(*eval(f'[{arguments.get(name, str())}]')) if callable(value) else value\n"
        "before = repr(keep)\npid = os.fork()\n"
        "if pid == 0:\n    signal.alarm(20)\n    raised = []\n"
        "    for name in names:\n"
        "        try:\n            act(name)\n"
        "        except ks.ForkError as error:\n            assert 'spawn' in str(error)\n            raised.append(name)\n"
        "    print(*sorted(set(names) - set(raised)), flush=True)\n    del keep, sim, arm\n    os._exit(7)\n"
        "status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])\nassert repr(keep) == before\nact('finish' if 'finish' in names else 'close')\n"
        "print(type(keep).__name__, status)\n"
    )
    result = python(code, cwd=tmp_path, env={**os.environ, "DISPLAY": display})
    plain, last = result.stdout.split("\n")[:2] if result.stdout.count("\n") == 2 else (result.stdout, "")
    name, status = last.split() if last else ("", "")
    assert status == "7" and set(plain.split()) == WITHOUT_THREADS.get(name, set()), result.stdout + result.stderr


VIEWED = """
import signal, threading, time
import kinetoscope as ks
sim = ks.SimulationManager(num_envs=2, threads=2)
arm = sim.add_robot(ks.bundled_robot("sr5"))
server = sim.serve(speed=1e-3)
signal.alarm(60)
"""


def test_ctrl_c_while_a_viewer_paces():
    """A viewer waits inside the step, where signals were not handled: a step takes 10 s here."""
    code = VIEWED + (
        "import os\n"
        "sent = []\n"
        "def kick():\n    time.sleep(1.0)\n    arm.qpos\n    sent.append(time.time())\n    os.kill(os.getpid(), signal.SIGINT)\n"
        "threading.Thread(target=kick, daemon=True).start()\n"
        "try:\n    sim.update(100)\nexcept KeyboardInterrupt:\n    print(time.time() - sent[0], sim.time[0])\n"
    )
    result = python(code)
    late, reached = map(float, result.stdout.split())
    assert late < 0.2 and 0 < reached < 0.05, result.stderr


def test_other_threads_use_a_simulation_that_a_viewer_paces():
    """The lock is not held during the wait: closing the server ends the pace, and the update completes."""
    code = VIEWED + (
        "thread = threading.Thread(target=sim.update, args=(20,))\nthread.start()\ntime.sleep(0.5)\n"
        "assert thread.is_alive() and arm.qpos.shape == (2, 6)\n"
        "server.close()\nthread.join(20)\nprint(thread.is_alive(), round(sim.time[0], 9))\n"
    )
    result = python(code)
    assert result.stdout == "False 0.2\n", result.stdout + result.stderr


def test_pace_of_a_viewer():
    """50 steps of 10 ms at speed 2 take 0.25 s; without a viewer, much less."""
    code = VIEWED.replace("speed=1e-3", "speed=2.0") + (
        "started = time.perf_counter()\nsim.update(50)\nprint(time.perf_counter() - started)\n"
        "server.close()\nsim.update(1)\nstarted = time.perf_counter()\nsim.update(50)\nprint(time.perf_counter() - started)\n"
    )
    paced, free = map(float, python(code).stdout.split())
    # The first step starts the clock.
    assert paced > 0.24 and free < paced


def test_a_program_as_a_viewer():
    """A paused simulation waits in ``update``, runs single steps, and goes on when the viewer is closed. The command to pause
    is handled after the first step."""
    code = (
        "import threading, time, kinetoscope as ks\n"
        "sim = ks.SimulationManager(threads=1)\nviewer = sim.viewer()\nviewer.pause()\n"
        "thread = threading.Thread(target=sim.update, args=(20,), daemon=True)\nthread.start()\n"
        "def reached(steps):\n"
        "    for _ in range(400):\n"
        "        try:\n            state = viewer.state\n"
        # Before the first snapshot.
        "        except ks.ViewerError:\n            state = {'paused': False}\n"
        "        if round(sim.time[0] / sim.physics_dt) == steps and state['paused']:\n            return True\n"
        "        time.sleep(0.05)\n"
        "assert reached(1)\ntime.sleep(0.3)\nassert reached(1) and thread.is_alive()\n"
        "viewer.step(3)\nassert reached(4)\nviewer.step()\nassert reached(5)\ntime.sleep(0.3)\nassert reached(5)\n"
        "assert viewer.state['steps'] == 5 and viewer.state['refusal'] is None\n"
        "viewer.resume()\nthread.join(20)\nassert not thread.is_alive() and round(sim.time[0] / sim.physics_dt) == 20\n"
        # At half of real time, 50 steps of 10 ms take 1 s; the first steps handle the command and start the clock.
        "viewer.set_speed(0.5)\nstarted = time.perf_counter()\nsim.update(50)\nassert time.perf_counter() - started > 0.9\n"
        "assert viewer.state['speed'] == 0.5\n"
        "viewer.reset(0)\nsim.update(2)\nassert sim.time[0] < 3 * sim.physics_dt\n"
        "viewer.pause()\nviewer.close()\nviewer.close()\nsim.update(5)\nprint(repr(viewer))\n"
        "for call in (viewer.pause, lambda: viewer.state, lambda: sim.viewer().set_speed(0), lambda: sim.viewer().reset(1)):\n"
        "    try:\n        call()\n    except ks.KinetoscopeError as error:\n        print(type(error).__name__)\n"
    )
    result = python(code)
    expected = ["<Viewer, closed>", "ViewerError", "ViewerError", "ArgumentError", "OutOfRangeError"]
    assert result.stdout.split("\n")[:-1] == expected, result.stdout + result.stderr


def test_import_needs_the_library_of_mujoco(tmp_path):
    """Without the package mujoco, or with another version of its library, the error says what to install."""
    (tmp_path / "mujoco").mkdir()
    (tmp_path / "mujoco" / "__init__.py").touch()
    (tmp_path / "mujoco" / "libmujoco.so.3.0.0").touch()
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    result = python("import kinetoscope", env={**os.environ, "PYTHONPATH": path})
    assert re.search(r"ImportError: .*needs MuJoCo 4\.0\.1, but .* has libmujoco\.so\.3\.0\.0; install it with", result.stderr)


def least_cpu_time(code: str) -> float:
    """Smallest processor time of some lines in a new process, of three [s]."""
    measured = (
        "import resource\nuse = lambda: sum(resource.getrusage(resource.RUSAGE_SELF)[:2])\nstart = use()\n"
        f"{code}\nprint(use() - start)"
    )
    results = [python(measured) for _ in range(3)]
    return min(float(result.stdout) for result in results)


def test_import_is_fast():
    """Importing takes less than 0.15 s beyond NumPy. Processor time is no longer than wall time on a calm machine, apart
    from threads, of which the import starts none."""
    both, numpy = least_cpu_time("import numpy, kinetoscope"), least_cpu_time("import numpy")
    assert both - numpy < 0.15, (both, numpy)


def test_images_are_copied_once(tmp_path):
    """The memory of a process grows by one array per image that is read, without a copy in between, and not at all for an
    array of the caller. Arrays of 39 MB are mapped one by one, so that memory that was used before does not hide the peak."""
    code = (
        "import re\nimport numpy as np\nimport kinetoscope as ks\n"
        "sim = ks.SimulationManager(num_envs=32, threads=1)\nsim.add_rigid_object(uid='cube')\n"
        "cam = sim.add_sensor('c', ks.CameraCfg(width=640, height=480))\nmine = np.ones_like(cam['color'])\n"
        # `ru_maxrss` would begin with the memory of the process that started this one.
        "status = lambda: open('/proc/self/status').read()\n"
        "peak = lambda: 1024 * int(re.search(r'VmHWM:\\s*(\\d+) kB', status())[1]) / mine.nbytes\n"
        # The first arrays stay below the peak of the rendering.
        "kept, peaks = [cam['color'] for _ in range(3)], [peak()]\n"
        "for act in (lambda: kept.append(cam['color']), lambda: cam.read('color', out=mine), lambda: kept.extend([cam['color'].copy()])):\n"
        "    act()\n    peaks.append(peak())\n"
        "print(*np.diff(peaks))"
    )
    result = python(code, cwd=tmp_path)
    read, into, copied = map(float, result.stdout.split())
    assert 0.9 < read < 1.1 and into < 0.1, result.stdout
    # A control: another copy is seen.
    assert copied > 1.9, result.stdout


def test_first_image_is_fast():
    """From the start of the import to an image of an arm, 640 x 480 pixels: less than 0.5 s."""
    code = (
        "import kinetoscope as ks\nsim = ks.SimulationManager(threads=1)\nsim.add_robot(ks.bundled_robot('sr5'))\n"
        "look = ks.Placement.look_at(eye=[2, 0, 1], target=[0, 0, 0.3])\n"
        "cam = sim.add_sensor('c', ks.CameraCfg(extrinsics=ks.Extrinsics(placement=look)))\n"
        "assert cam['color'].shape == (1, 480, 640, 4) and cam['color'].any()"
    )
    assert least_cpu_time(code) < 0.5
