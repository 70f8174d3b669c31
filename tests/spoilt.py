"""Documents spoilt at random: what stands in them is replaced, removed, renamed or moved."""

import copy
from contextlib import suppress

from hypothesis import strategies as st


def any_data(scalars, keys, most, leaves):
    """JSON of any shape: lists and objects of up to ``most`` entries, so many leaves in all."""
    return st.recursive(
        scalars,
        lambda inner: st.lists(inner, max_size=most) | st.dictionaries(keys, inner, max_size=most),
        max_leaves=leaves,
    )


def places(data, path=()):
    """Paths to all objects, lists and values of a document."""
    yield path
    if isinstance(data, dict | list):
        for key, item in data.items() if isinstance(data, dict) else enumerate(data):
            yield from places(item, (*path, key))


def found(data, path):
    """What stands at a path."""
    for key in path:
        data = data[key]
    return data


@st.composite
def spoilt(draw, good, most, *, data, numbers=None, names=None):
    """A document with up to ``most`` places spoilt; numbers and names where they are given."""
    document = copy.deepcopy(good)
    somewhere = st.sampled_from([path for path in places(good) if path])
    ways = ["replace", "remove", "copy"]
    ways += [way for way, given in (("number", numbers), ("rename", names)) if given is not None]
    for path in draw(st.lists(somewhere, min_size=1, max_size=most)):
        with suppress(LookupError, TypeError, AttributeError):  # it is gone by now
            box, key = found(document, path[:-1]), path[-1]
            way = draw(st.sampled_from(ways))
            if way == "number":
                box[key] = draw(numbers)
            elif way == "replace":
                box[key] = draw(data)
            elif way == "copy":
                box[key] = copy.deepcopy(found(good, draw(somewhere)))
            else:
                item = box.pop(key)
                if way == "rename" and isinstance(box, dict):
                    box[draw(names)] = item
    return document
