"""Examples in docstrings: what they may name, and the doctests of a module."""

import doctest
import inspect
from functools import cache, cached_property

import numpy as np

import blockmech as bm
from tests.gallery import GRAPHS


@cache
def fourbar():
    """A graph, a linkage, a mechanism and a result, shared by all examples."""
    graph = bm.read(GRAPHS / "ruiz_fourbar.json")
    linkage = bm.read(GRAPHS / "joints" / "slider_crank.json")
    mechanism = graph.compile()
    return graph, linkage, mechanism, mechanism.run(at=[0.5, 1.0])


def names():
    """What an example finds when it begins, as `help(blockmech)` says; documents are its own."""
    graph, linkage, mechanism, result = fourbar()
    documents = {"g": graph.snapshot(), "m": linkage.snapshot()}
    return {"bm": bm, "np": np, **documents, "mech": mechanism, "result": result}


class Finder(doctest.DocTestFinder):
    """Also finds examples of cached properties, which doctest takes for attributes."""

    def _find(self, tests, obj, name, module, *rest):
        super()._find(tests, obj, name, module, *rest)
        for key, item in vars(obj).items() if isinstance(obj, type) else ():
            if isinstance(item, cached_property):
                super()._find(tests, item.func, f"{name}.{key}", module, *rest)


@cache
def texts_with_examples(module):
    """The docstrings of a module whose examples `run_examples` runs."""
    return {inspect.cleandoc(test.docstring) for test in Finder().find(module) if test.examples}


def run_examples(module):
    """Run all examples of a module: the number of those that failed, and of all."""
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    for test in Finder().find(module):
        test.globs |= names()
        runner.run(test)
    return runner.summarize()
