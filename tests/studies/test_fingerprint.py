"""The fingerprint of a law in Python follows whatever the law computes with."""

import os
import subprocess
import sys

import pytest

import blockmech as bm
from blockmech.studies.fingerprint import content_of

MODULE = "import types\nhelpers = types.ModuleType('helpers')\nexec({!r}, vars(helpers))\n"
LAWS = {
    "closure": "def make(k):\n    return lambda time: k * time\nlaw = make({gain})",
    "name of the module": "gain = {gain}\nlaw = lambda time: gain * time",
    "function": "def torque(time):\n    return {gain} * time\nlaw = lambda time: torque(time)",
    "partial": "from functools import partial\nlaw = partial(lambda k, time: k * time, {gain})",
    "function of a module": MODULE.format("def torque(time):\n    return {gain} * time")
    + "law = lambda time: helpers.torque(time)",
    "name of a module": MODULE.format("gain = {gain}") + "law = lambda time: helpers.gain * time",
    "value of an object": "class Load:\n    def __init__(self, k):\n        self.k = k\n"
    "    def __call__(self, time):\n        return self.k * time\nlaw = Load({gain})",
    "method": "class Load:\n    def __call__(self, time):\n        return self.torque(time)\n"
    "    def torque(self, time):\n        return {gain} * time\nlaw = Load()",
    "bound method": "class Load:\n    k = {gain}\n    def torque(self, time):\n"
    "        return self.k * time\nlaw = Load().torque",
    "property of a base": "class Base:\n    @property\n    def k(self):\n        return {gain}\n"
    "class Load(Base):\n    def __call__(self, time):\n        return self.k * time\nlaw = Load()",
    "static method": "class Load:\n    @staticmethod\n    def torque(time):\n"
    "        return {gain} * time\nlaw = lambda time: Load.torque(time)",
    "array": "import numpy as np\ntable = np.full(5000, {gain})\n"
    "law = lambda time: float(np.interp(time, np.arange(5000.0), table))",
}


def law(text, gain):
    space = {"__name__": "__main__"}
    exec(text.replace("{gain}", str(gain)), space)
    return space["law"]


@pytest.mark.parametrize("text", LAWS.values(), ids=[*LAWS])
def test_a_law_with_another_gain_is_another_question(text):
    first, same, second = (content_of(law(text, gain)) for gain in (1.0, 1.0, 2.0))
    assert first == same
    assert first != second


def test_the_class_that_a_method_names_may_be_its_own():
    text = "class Load:\n    k = {gain}\n    def __call__(self, time):\n        return Load.k\n"
    assert content_of(law(f"{text}law = Load()", 1.0)) != content_of(
        law(f"{text}law = Load()", 2.0)
    )


def test_what_nothing_tells_apart_is_refused():
    with pytest.raises(bm.RequestError, match="reads a generator, whose value cannot be compared"):
        content_of(law("rows = (x for x in [{gain}])\nlaw = lambda time: next(rows)", 1.0))


def test_a_fingerprint_is_the_same_in_every_process():
    text = "from blockmech.studies.fingerprint import content_of\n"
    text += "print(content_of(lambda time: time if 'a' in {'a', 'b', 'c', 'd'} else 0.0))"
    digests = {
        subprocess.run(
            [sys.executable, "-c", text],
            env=os.environ | {"PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in "123"
    }
    assert len(digests) == 1
