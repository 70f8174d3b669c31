# ruff: noqa: E501
"""Machines of our own as drawings of every format that is read; `python -m tests.exchange.corpus`
writes them to tests/data/drawings, with the places that their own distances give over 24 poses.

A machine is points, links as lists of points, fixed points, slots (point -> carrier and two of its
points, or "" and an angle), rigid slots (points whose link slides without turning) and a crank.
"""

import cmath
import json
import math
from pathlib import Path
from typing import NamedTuple

from tests.exchange.distances import Distances, turn

FOLDER = Path(__file__).parents[1] / "data" / "drawings"
DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_-"


class Machine(NamedTuple):
    points: dict
    links: dict
    fixed: str
    slots: dict = {}
    rigid: str = ""
    crank: str = "AB"  # its centre and its pin

    def rider(self, point):
        """The link that slides with a rigid slot."""
        return next(name for name, points in self.links.items() if point in points)

    def solver(self):
        lines = {}
        for point, (_, a, b) in self.slots.items():
            lines[point] = (a, b) if isinstance(b, str) else (point, b)
        bodies = [list(own) for own in self.links.values()]
        points, fixed = dict(self.points), list(self.fixed)
        for point in self.rigid:  # a point beside it keeps the direction of the link's own
            _, a, b = self.slots[point]
            rider = self.links[self.rider(point)]
            line = points[b] - points[a] if isinstance(b, str) else cmath.exp(1j * b)
            far_point = max(rider, key=lambda p: abs(((points[p] - points[point]) / line).real))
            if isinstance(b, str):
                line_vector = points[b] - points[a]
                span = (points[far_point] - points[point]) / line_vector
                helper = f"{point}'"
                # fixed to the carrier, on a parallel of the slot through the other point
                points[helper] = points[a] + 1j * line_vector * span.imag
                points[f"{helper}'"] = points[helper] + line_vector
                bodies = [[*x, helper, f"{helper}'"] if set(x) >= {a, b} else x for x in bodies]
                lines[far_point] = (helper, f"{helper}'")
            else:
                lines[far_point] = (far_point, b)
        return Distances(points, bodies, fixed, lines, tuple(self.crank))


def on(a, b, t):
    """A point of a line, to a thousandth."""
    z = a + t * (b - a)
    return complex(round(z.real, 3), round(z.imag, 3))


G = {"A": 0j, "B": 1 + 1.5j, "C": 5 + 3j, "D": 4.5 - 0.5j}
WHIT = 0.3 - 4.2j
MACHINES = {
    "rocker": Machine({**G, "E": 3.2 + 4.1j}, {"a": "AB", "b": "BCE", "c": "CD"}, "AD"),
    "slider": Machine(
        {"A": 0j, "B": 0.8 + 1.1j, "C": 5.2 + 0j},
        {"a": "AB", "b": "BC"},
        "A",
        {"C": ("", "C", 0.0)},
    ),
    "offset": Machine(
        {"A": 0j, "B": 0.4 + 1.2j, "C": 4.1 + 2.7j, "E": 2 + 3j},
        {"a": "AB", "b": "BCE"},
        "A",
        {"C": ("", "C", 0.4)},
    ),
    "whitworth": Machine(
        {"A": 0j, "B": 1.2 + 0.7j, "C": WHIT, "D": on(WHIT, 1.2 + 0.7j, 1.4)},
        {"a": "AB", "c": "CD"},
        "AC",
        {"B": ("c", "C", "D")},
    ),
    "slotted": Machine(
        {**G, "E": 2.2 + 0.5j, "F": on(G["B"], G["C"], 1.7)},
        {"a": "AB", "b": "BC", "c": "CD", "e": "EF"},
        "ADE",
        {"F": ("b", "B", "C")},
    ),
    "watt": Machine(
        {**G, "E": 6.5 + 4.2j, "F": 9.5 + 5.5j, "H": 9 - 1j},
        {"a": "AB", "b": "BC", "c": "CDE", "e": "EF", "f": "FH"},
        "ADH",
    ),
    "stephenson": Machine(
        {**G, "E": 3 + 4.5j, "F": 7 + 9j, "H": 8.5 + 2.5j},
        {"a": "AB", "b": "BCE", "c": "CD", "e": "EF", "f": "FH"},
        "ADH",
    ),
    "yoke": Machine(
        {"A": 0j, "B": 0.9 + 0.8j, "C": 0.9 - 2.1j, "D": 0.9 + 2.4j, "E": 3 + 1j},
        {"a": "AB", "y": "CDE"},
        "A",
        {"B": ("y", "C", "D"), "C": ("", "C", 0.0)},
        "C",
    ),
    "cylinder": Machine(
        {
            "A": 0j,
            "B": 0.7 + 1j,
            "C": 5 + 1j,
            "D": on(5 + 1j, 0.7 + 1j, 0.4),
            "E": on(5 + 1j, 0.7 + 1j, 0.3),
        },
        {"a": "AB", "c": "CD", "r": "BE"},
        "AC",
        {"E": ("c", "C", "D")},
        "E",
    ),
    "shaper": Machine(
        {
            "A": 0j,
            "B": 1.1 + 0.4j,
            "C": -3.1j,
            "D": on(-3.1j, 1.1 + 0.4j, 1.6),
            "R": 5.6 + 3.2j,
        },
        {"a": "AB", "c": "CD", "r": "DR"},
        "AC",
        {"B": ("c", "C", "D"), "R": ("", "R", 0.0)},
    ),
    "swing": Machine(
        {
            "A": 0j,
            "B": 1.3 + 0.5j,
            "C": on(1.3 + 0.5j, 6.6 - 1.3j, 0.7),
            "D": 6.6 - 1.3j,
            "P": 4.7 + 2j,
        },
        {"a": "AB", "d": "BDP"},
        "AC",
        {"C": ("d", "B", "D")},
    ),
    "welded": Machine(
        {**G, "E": 3 + 4.2j, "F": 7 + 4.5j, "H": 7.5 - 1j},
        {"a": "AB", "b": "BCE", "c": "CD", "f": "EF", "h": "FH"},
        "ADH",
    ),
}
SLOTTED = ("slider", "offset", "whitworth", "slotted", "shaper")
PINNED = ("rocker", "watt", "stephenson", "welded")


# -- formats ---------------------------------------------------------------------------------


def digits(value):
    n = round(abs(value) * 1000)
    text = ""
    while n or not text:
        text, n = DIGITS[n % 64] + text, n // 64
    return f"0{text}" if value < 0 else text


def joint(flags, key, z, angle=0.0, suffix=""):
    return f"{DIGITS[flags]}{key},{key},{digits(z.real)},{digits(z.imag)},{digits(angle)}{suffix}"


def pmks_plus(m, single=False, split=False, head="2P.Fe,1E8.K,0.1011"):
    """An address; sliders as one joint or as three, and a link as two that are welded."""
    names = {name: "".join(corners) for name, corners in m.links.items()}
    records, blocks = [], []
    for key, z in m.points.items():
        flags = 4 * (key in m.fixed) | 2 * (key == m.crank[0])
        if key in m.slots:
            carrier, a, b = m.slots[key]
            suffix = f",{names[carrier]},{a},{b}" if carrier else ""
            slide = 1 | (0 if carrier else 4)
            angle = 0.0 if carrier else b
            if single:
                slide |= flags
                records.append(joint(slide | 8 * (key in m.rigid), key, z, angle, suffix))
                continue
            records.append(joint(slide, f"{key.lower()}", z, angle, suffix))
            blocks.append(f"YP{key}{key.lower()},{key}{key.lower()},0,0,0,0,,{key},{key.lower()},,")
            flags |= 8 * (key in m.rigid)
        records.append(joint(flags | 8 * (split and key == "E"), key, z))
    links = []
    for name, corners in m.links.items():
        c = sum(m.points[p] for p in corners) / len(corners)
        body = f"{digits(120.0)},{digits(0.35)},{digits(c.real)},{digits(c.imag)},c5cae9"
        if split and name == "b":  # two bars of one coupler, a compound
            parts = [corners[0] + corners[2], corners[2] + corners[1]]
            links.append(
                f"YR{names[name]},{names[name]},{body},{','.join(corners)},,{','.join(parts)}"
            )
            links += [f"NR{x},{x},{body},{','.join(x)},," for x in parts]
        else:
            links.append(f"YR{names[name]},{names[name]},{body},{','.join(corners)},,")
    forces = ""
    if not m.slots:
        forces = f"2F1,{names['b']},F1,{digits(2.0)},{digits(2.5)},{digits(2.0)},{digits(1.5)},Fe."
    code = f"{head}.{'.'.join(records)}..{'.'.join(links + blocks)}..{forces}.N_"
    return f"https://app.pmksplus.com/?{code}{DIGITS[:62][len(code) % 62]}"


def pmks_plus_old(m, early=False):
    """An address of before 2023, of the two orders of words."""
    names = {name: "".join(members) for name, members in m.links.items()}
    sliders = {key: f"{key}{key.lower()}" for key in m.slots}
    joints, links = "", ""
    for key, z in m.points.items():
        members = [names[n] for n, points in m.links.items() if key in points]
        members += [sliders[key]] if key in sliders else []
        ground, drive = ("t" if x else "f" for x in (key in m.fixed, key == m.crank[0]))
        rest = f"{ground},{drive},Null" if early else f"{ground},Null,{drive}"
        joints += f"{key},{z.real:g},{z.imag:g},{'|'.join(members)},R,{rest}\n"
        if key in sliders:
            angle = m.slots[key][2]
            rest = f"t,f,{angle}," if early else f"t,{angle},f"
            joints += f"{key.lower()},{z.real:g},{z.imag:g},{sliders[key]},P,{rest}\n"
    for name, members in m.links.items():
        kind = "" if early else "R,"
        links += f"{names[name]},{kind}1,1,0,0,{'|'.join(members)},,{'line' if early else ''}\n"
    if not early:
        for key, name in sliders.items():
            links += f"{name},P,1,Null,Null,Null,{key}|{key.lower()},,\n"
    text = f"https://app.pmksplus.com/?j={joints}&l={links}&f=&s=10,true,false,cm"
    return text.replace("\n", "%0A")


def rows(m):
    """Joints of PMKS: links, type, place, angle [deg], driven."""
    for key, z in m.points.items():
        members = [n for n, points in m.links.items() if key in points]
        kind, angle = "R", 0.0
        if key in m.fixed:
            members = ["ground", *members]
        if key in m.slots:
            carrier, a, b = m.slots[key]
            kind = "RP"
            angle = cmath.phase(m.points[b] - m.points[a]) if carrier else b
            members = [carrier or "ground", *(x for x in members if x not in (carrier, "ground"))]
            members += ["ground"] * (key in m.fixed)
        yield members, kind, z, math.degrees(angle), key == m.crank[0]


def pmks_text(m):
    lines = (
        f"{','.join(members)},{kind},{z.real},{z.imag},{angle!r},tff{'t' if drive else 'f'}\n"
        for members, kind, z, angle, drive in rows(m)
    )
    return "".join(lines)


def pmks_json(m):
    keys = ("Links", "TypeOfJoint", "X", "Y", "Angle")
    table = [dict(zip(keys, (o, k, z.real, z.imag, a), strict=True)) for o, k, z, a, _ in rows(m)]
    return json.dumps({"Joints": table, "DrivingIndex": 0, "InputSpeed": 2.0})


def pyslvs(m):
    text = ", ".join(
        f"J[{kind}, {f'A[{angle!r}], ' if kind != 'R' else ''}P[{z.real}, {z.imag}], L[{', '.join(members)}]]"
        for members, kind, z, angle, _ in rows(m)
    )
    return f"M[{text}]"


def linkage2(m):
    ids = {key: k for k, key in enumerate(m.points)}
    out = ['<linkage2><program zoom="1" units="Millimeters" scalefactor="1"/>']
    slots = {}
    for key, (carrier, a, b) in m.slots.items():
        if not carrier:  # two anchors on its line
            ends = [m.points[key] + s * cmath.exp(1j * b) for s in (-3.0, 3.0)]
            a, b = f"{key}<", f"{key}>"
            slots |= dict(zip((a, b), ends, strict=True))
            ids |= {a: len(ids), b: len(ids) + 1}
        limits = f'<slidelimit id="{ids[a]}"/><slidelimit id="{ids[b]}"/>'
        slots[key] = limits
    for key, z in {
        **m.points,
        **{k: v for k, v in slots.items() if not isinstance(v, str)},
    }.items():
        anchor = ' anchor="true"' * (key in m.fixed or key not in m.points)
        drive = ' input="true" rpm="-12"' * (key == m.crank[0])
        slide = ' slider="true"' * (key in m.slots)
        inner = slots[key] if key in m.slots else ""
        at = f'id="{ids[key]}" x="{z.real!r}" y="{z.imag!r}"'
        out.append(f"<connector {at}{anchor}{drive}{slide}>{inner}</connector>")
    for k, corners in enumerate(m.links.values()):
        inner = "".join(f'<connector id="{ids[p]}"/>' for p in corners)
        out.append(f'<Link id="{k}">{inner}</Link>')
    return "".join([*out, "</linkage2>"])


def pylinkage(m):
    joints = []
    for key, z in m.points.items():
        kind = "ground" if key in m.fixed else "revolute"
        joints.append({"id": key, "type": kind, "position": [z.real, z.imag]})
        if key in m.slots:
            b = m.slots[key][2]
            joints[-1] |= {"type": "prismatic", "axis": [math.cos(b), math.sin(b)]}
    links = [{"id": n, "type": "link", "joints": list(corners)} for n, corners in m.links.items()]
    links[0] |= {"type": "driver", "motor_joint": "A", "angular_velocity": 0.1}
    return json.dumps({"name": "m", "joints": joints, "links": links})


def sketch_svg(m):
    def circle(key):
        z = m.points[key]
        return f'<circle cx="{z.real!r}" cy="{-z.imag!r}" r="0.1"/>'

    out = ['<svg xmlns="http://www.w3.org/2000/svg" width="100mm" viewBox="0 0 100 100">']
    groups = {"frame": m.fixed, **m.links, "drive": m.crank[0]}
    out += [f'<g id="{n}">{"".join(map(circle, corners))}</g>' for n, corners in groups.items()]
    for key, (carrier, a, b) in m.slots.items():
        ends = [m.points[x] for x in (a, b)] if carrier else None
        ends = ends or [m.points[key] + s * cmath.exp(1j * b) for s in (-2, 2)]
        xy = [f'{z.real!r}" y{k}="{-z.imag!r}' for k, z in enumerate(ends, 1)]
        out.append(f'<g id="slot {carrier or "frame"}"><line x1="{xy[0]}" x2="{xy[1]}"/></g>')
    return "".join([*out, "</svg>"])


def sketch_dxf(m):
    pairs = [(0, "SECTION"), (2, "HEADER"), (9, "$INSUNITS"), (70, 4), (0, "ENDSEC")]
    pairs += [(0, "SECTION"), (2, "ENTITIES")]
    for layer, corners in {"frame": m.fixed, **m.links, "drive": m.crank[0]}.items():
        for key in corners:
            z = m.points[key]
            pairs += [(0, "CIRCLE"), (8, layer), (10, z.real), (20, z.imag), (40, 0.1)]
    for key, (carrier, a, b) in m.slots.items():
        ends = [m.points[x] for x in (a, b)] if carrier else None
        p, q = ends or [m.points[key] + s * cmath.exp(1j * b) for s in (-2, 2)]
        pairs += [(0, "LINE"), (8, f"slot {carrier or 'frame'}"), (10, p.real), (20, p.imag)]
        pairs += [(11, q.real), (21, q.imag)]
    pairs += [(0, "ENDSEC"), (0, "EOF")]
    return "".join(f"{code}\n{value!r}\n".replace("'", "") for code, value in pairs)


# -- bodies and joints -----------------------------------------------------------------------


def joints_of(m):
    """Pins and guides: (name, kind, first, second, place, angle); sliders have links of their own."""
    out = []
    for key, z in m.points.items():
        ends = ["frame"] * (key in m.fixed) + [
            n for n, corners in m.links.items() if key in corners
        ]
        if key in m.slots:
            carrier, a, b = m.slots[key]
            angle = cmath.phase(m.points[b] - m.points[a]) if carrier else b
            slider = m.rider(key) if key in m.rigid else f"block_{key}"
            foot = z
            if carrier:
                unit = cmath.exp(1j * angle)
                foot = m.points[a] + unit * ((z - m.points[a]) / unit).real
            out.append((f"{key}_slide", "P", carrier or "frame", slider, foot, angle, z))
            ends = [slider, *(x for x in ends if x not in (carrier, slider))]
        out += [(key, "R", ends[0], second, z, 0.0, z) for second in ends[1:]]
    return [(f"{n}{k}" if n in {x[0] for x in out[:k]} else n, *r) for k, (n, *r) in enumerate(out)]


def turned(angle):
    c, s = math.cos(angle), math.sin(angle)
    return ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))


ALONG = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))  # its z axis is x


def product(a, b):
    return tuple(
        tuple(sum(x * y for x, y in zip(r, c, strict=True)) for c in zip(*b, strict=True))
        for r in a
    )


def asmt(m):
    """Parts that are turned against each other; slides along the z axis of their markers."""

    def pose(depth, z, axes):
        tab = "\t" * depth
        numbers = ["\t".join(repr(float(x)) for x in row) for row in axes]
        position = f"{z.real!r}\t{z.imag!r}\t0.0"
        lines = ["Position3D", f"\t{position}", "RotationMatrix", *(f"\t{row}" for row in numbers)]
        return [tab + line for line in lines]

    joints, parts = joints_of(m), {"frame": (0j, 0.0)}
    for k, name in enumerate(dict.fromkeys(x for j in joints for x in j[2:4])):
        if name != "frame":
            parts[name] = (complex(0.3 * k, -0.2 * k), 0.4 * k)
    markers = {name: [] for name in parts}
    for name, kind, first, second, z, angle, z2 in joints:
        for end, position in ((first, z), (second, z2)):
            o, turn_ = parts[end]
            local = (position - o) * cmath.exp(-1j * turn_)
            axes = turned(angle - turn_)
            markers[end].append((name, local, product(axes, ALONG) if kind == "P" else axes))
    out = ["OndselSolver", "Assembly", "\tName", "\t\tm", *pose(1, 0j, turned(0))]

    def points(depth, name):
        tab = "\t" * depth
        lines = [f"{tab}RefPoints"]
        for key, local, axes in markers[name]:
            lines += [f"{tab}\tRefPoint", *pose(depth + 2, 0j, turned(0)), f"{tab}\t\tMarkers"]
            lines += [f"{tab}\t\t\tMarker", f"{tab}\t\t\t\tName", f"{tab}\t\t\t\t\t{key}"]
            lines += pose(depth + 4, local, axes)
        return lines

    out += [*points(1, "frame"), "\tParts"]
    for name, (o, turn_) in parts.items():
        if name != "frame":
            out += ["\t\tPart", "\t\t\tName", f"\t\t\t\t{name}", *pose(3, o, turned(turn_))]
            out += ["\t\t\tPrincipalMassMarker", *pose(4, 0.1 + 0.2j, turned(0))]
            out += ["\t\t\t\tMass", "\t\t\t\t\t2.0", "\t\t\t\tMomentOfInertias"]
            out += ["\t\t\t\t\t0.1\t0.2\t0.3", *points(3, name)]
    out += ["\tConstraintSets", "\t\tJoints"]
    for name, kind, first, second, *_ in joints:
        path = [f"/m/{name}" if x == "frame" else f"/m/{x}/{name}" for x in (first, second)]
        out += [f"\t\t\t{'RevoluteJoint' if kind == 'R' else 'TranslationalJoint'}"]
        out += ["\t\t\t\tName", f"\t\t\t\t\t{name}", "\t\t\t\tMarkerI", f"\t\t\t\t\t{path[0]}"]
        out += ["\t\t\t\tMarkerJ", f"\t\t\t\t\t{path[1]}"]
    out += ["\t\tMotions", "\t\t\tRotationalMotion", "\t\t\t\tName", "\t\t\t\t\tdrive"]
    out += ["\t\t\t\tMotionJoint", f"\t\t\t\t\t/m/{m.crank[0]}", "\t\t\t\tRotationZ"]
    first = next(j for j in joints if j[0] == m.crank[0])
    start = parts[first[2]][1] - parts[first[2]][1]  # both markers are drawn along x
    out += [f"\t\t\t\t\t{start!r} + 3.0d*time", "\tConstantGravity", "\t\t0.0\t-9.81\t0.0"]
    return "\n".join(out) + "\n"


def xyz(z, upright):
    return f"{z.real!r} 0 {z.imag!r}" if upright else f"{z.real!r} {z.imag!r} 0"


def tree_of(m):
    """Body -> its joint of the tree, and the joints that close loops; guides stand in the tree."""
    joints = joints_of(m)
    joints.sort(key=lambda j: (j[0] != m.crank[0], j[1] != "P"))
    above, loops, waiting = {}, [], list(joints)
    reached = {"frame"}
    while waiting:
        k = next(k for k, j in enumerate(waiting) if (j[2] in reached) or (j[3] in reached))
        j = waiting.pop(k)
        if j[2] in reached and j[3] in reached:
            loops.append(j)
            continue
        child, parent = (j[3], j[2]) if j[2] in reached else (j[2], j[3])
        above[child] = (parent, j)
        reached.add(child)
    return above, loops


def mjcf(m, upright=False):
    above, loops = tree_of(m)
    axis = "0 -1 0" if upright else "0 0 1"

    def bodies(parent, at):
        for child, (base, (name, kind, first, _, z, angle, _)) in above.items():
            if base != parent:
                continue
            sense = 1 if first == parent else -1
            axis_text = xyz(sense * cmath.exp(1j * angle), upright)
            joint_ = f'<joint name="{name}" type="slide" axis="{axis_text}"/>'
            if kind == "R":
                turn_ = " ".join(str(sense * int(x)) for x in axis.split())
                joint_ = f'<joint name="{name}" axis="{turn_}" damping="0.01"/>'
            geom = f'<geom type="capsule" size="0.02" fromto="0 0 0 {xyz(0.3 + 0.1j, upright)}"/>'
            yield f'<body name="{child}" pos="{xyz(z - at, upright)}">{joint_}{geom}'
            yield from bodies(child, z)
            yield "</body>"

    origins = {"frame": 0j} | {child: j[4] for child, (_, j) in above.items()}
    out = ['<mujoco model="m"><option gravity="0 0 0"/><worldbody>', *bodies("frame", 0j)]
    out += ["</worldbody><equality>"]
    for name, kind, first, second, z, _, z2 in loops:
        assert kind == "R"
        inner, outer = (second, first) if first == "frame" else (first, second)
        body2 = "" if outer == "frame" else f' body2="{outer}"'
        at = z2 if inner == second else z
        out.append(
            f'<connect name="{name}" body1="{inner}"{body2} anchor="{xyz(at - origins[inner], upright)}"/>'
        )
    out += [f'</equality><actuator><motor joint="{m.crank[0]}"/></actuator></mujoco>']
    return "".join(out)


def urdf(m, upright=False):
    above, loops = tree_of(m)
    axis = "0 -1 0" if upright else "0 0 1"
    origins = {"frame": 0j} | {child: j[4] for child, (_, j) in above.items()}
    out = ['<robot name="m"><link name="frame"/>']
    inertia = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/>'
    body = f'<inertial><origin xyz="0.1 0 0"/><mass value="1.5"/>{inertia}</inertial>'
    out += [f'<link name="{child}">{body}</link>' for child in above]
    for child, (parent, (name, kind, first, _, z, angle, _)) in above.items():
        sense = 1 if first == parent else -1
        axis_text = xyz(sense * cmath.exp(1j * angle), upright) if kind == "P" else axis
        if sense < 0 and kind == "R":
            axis_text = " ".join(str(-int(x)) for x in axis.split())
        limit = '<limit lower="-9" upper="9" effort="1" velocity="1"/>' if kind == "P" else ""
        out.append(
            f'<joint name="{name}" type="{"prismatic" if kind == "P" else "continuous"}">'
            f'<parent link="{parent}"/><child link="{child}"/><axis xyz="{axis_text}"/>{limit}'
            f'<origin xyz="{xyz(z - origins[parent], upright)}"/></joint>'
        )
    for name, _, first, second, z, _, z2 in loops:
        ends = [(first, z), (second, z2)]
        inner = "".join(
            f'<link{k} link="{link}" xyz="{xyz(at - origins[link], upright)}"/>'
            for k, (link, at) in enumerate(ends, 1)
        )
        out.append(
            f'<loop_joint name="{name}" type="continuous">{inner}<axis xyz="{axis}"/></loop_joint>'
        )
    out.append(f'<transmission name="t"><joint name="{m.crank[0]}"/></transmission></robot>')
    return "".join(out)


def sdf(m, upright=False):
    joints = joints_of(m)
    axis = "0 -1 0" if upright else "0 0 1"
    names = [x for x in dict.fromkeys(x for j in joints for x in j[2:4]) if x != "frame"]
    origins = {"frame": 0j} | {name: complex(0.5 * k, 0.25 * k) for k, name in enumerate(names)}
    out = ['<sdf version="1.9"><model name="m">']
    for name in names:
        inertia = "<inertia><ixx>1</ixx><iyy>2</iyy><izz>3</izz></inertia>"
        body = f"<inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass>{inertia}</inertial>"
        out.append(
            f'<link name="{name}"><pose>{xyz(origins[name], upright)} 0 0 0</pose>{body}</link>'
        )
    for name, kind, first, second, _, angle, z2 in joints:
        parent, child = (("world" if x == "frame" else x) for x in (first, second))
        axis_text, sort = (
            (axis, "revolute")
            if kind == "R"
            else (xyz(cmath.exp(1j * angle), upright), "prismatic")
        )
        at = z2 - origins[second]
        out.append(
            f'<joint name="{name}" type="{sort}"><parent>{parent}</parent><child>{child}</child>'
            f'<pose>{xyz(at, upright)} 0 0 0</pose><axis><xyz expressed_in="__model__">{axis_text}</xyz></axis></joint>'
        )
    return "".join([*out, "</model></sdf>"])


def drawings():
    """File name -> its machine, its text and its unit [m]."""
    cases = {}

    def add(machines, suffix, write, unit, tag=""):
        for k, name in enumerate(machines):
            text = (
                write(MACHINES[name], k % 2 == 1)
                if unit == 1.0 and suffix != "asmt"
                else write(MACHINES[name])
            )
            cases[f"{name}{tag}.{suffix}"] = (name, text, unit)

    planar = ("rocker", "watt", "stephenson", "welded", *SLOTTED, "swing")
    add(MACHINES, "pmksplus", pmks_plus, 0.01)
    add(
        (*SLOTTED, "yoke", "cylinder", "swing"),
        "pmksplus",
        lambda m: pmks_plus(m, True),
        0.01,
        "_single",
    )
    add(("welded",), "pmksplus", lambda m: pmks_plus(m, split=True), 0.01, "_parts")
    old = ("rocker", "watt", "slider", "offset")
    add(old, "url", pmks_plus_old, 0.01)
    add(old, "url", lambda m: pmks_plus_old(m, True), 0.01, "_early")
    add(planar, "txt", pmks_text, 1e-3)
    add(planar, "pmks", pmks_json, 1e-3)
    add(planar, "pyslvs", pyslvs, 1e-3)
    add((*PINNED, *SLOTTED), "linkage2", linkage2, 1e-3)
    add((*PINNED, "slider", "offset"), "json", pylinkage, 1e-3)
    add(("rocker", "watt", "slider", "whitworth"), "svg", sketch_svg, 1e-3)
    add(("rocker", "watt", "slider", "whitworth"), "dxf", sketch_dxf, 1e-3)
    add(MACHINES, "asmt", asmt, 1.0)
    for write, suffix in ((mjcf, "mjcf"), (urdf, "urdf"), (sdf, "sdf")):
        add((*PINNED, *SLOTTED, "yoke", "cylinder"), suffix, write, 1.0)
    return cases


def main():
    """Write the corpus."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name, (_, text, _) in drawings().items():
        (FOLDER / name).write_text(text, "utf-8")
    positions = {}
    for name, machine in MACHINES.items():
        poses = machine.solver().follow(turn())
        rows_ = {p: [[z.real, z.imag] for z in row] for p, row in poses.items() if len(p) == 1}
        positions[name] = rows_
    (FOLDER / "places.json").write_text(json.dumps(positions), "utf-8")


if __name__ == "__main__":
    main()
