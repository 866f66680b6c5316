"""Make the meshes of the bundled scene `engine`: a block, a piston, a crankshaft.

    python -m pip install manifold3d        # used by this script alone
    python tools/make_engine_scene.py       # writes proximity_monitor/scene/bundled/engine/meshes

The engine is shaped after the 1.3 litre Suzuki G13B, an inline four with five main bearings.
Lengths are millimetres. The published figures and their sources follow; if only the manual of a
sister engine was available, the source says so:

=======================  ===================  ================================================
bore x stroke            74 x 75.5            Wikipedia, "Suzuki G engine"
cylinder spacing         84                   the same
piston in bore, grade 1  73.98-73.99 in       Suzuki Swift SF310 service manual, section 6A1
                         74.01-74.02
main journal             45                   Suzuki Vitara service manual, page 3-32: bearing
                                              cap 49.00 less two shells of 2.00
crankpin                 41.982-42.000        Suzuki Swift 2007 manual, page 1D-52 (M engine)
main bearing clearance   0.025-0.045          Suzuki Ignis RG413 manual, page 6A1-77 (M13)
connecting rod, centres  120                  usually quoted for the G13; no factory source
=======================  ===================  ================================================

All other sizes are the project's own. The connecting rods are not modelled.

Axes: x along the crankshaft from front to rear, z up the cylinders. Block and crankshaft have
their origin on the crankshaft's axis at the engine's centre, the piston at its wrist pin's centre.
At crank angle 0 pistons 1 and 4 are at top dead centre.

**What the facets do to the clearances.** Moving parts are polygons inscribed in their circles (64
sides). Holes in the block are circumscribed about their circles (80 sides). So nothing overlaps
that would not overlap in the round engine. The distance between two concentric polygons is exactly
``R - r cos(d)``, with d the angle from a vertex of the inner polygon to the middle of the nearest
side of the outer one. If one of them turns, d repeats every 360 / lcm(64, 80) = 1.125 degrees:

- piston in its bore: d = 0, so 37.010 - 36.990 = 0.020 mm at every crank angle;
- journal in its bearing: d <= 0.5625 degrees, so 0.0200 to 0.0211 mm as the crankshaft turns;
- neighbouring pistons side by side: 84 - 2 x 36.990 = 10.020 mm.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from solids import along_x, along_y, box, prism, revolve, ring, union, write_ply

HERE = Path(__file__).resolve().parent
MESHES = HERE.parent / "proximity_monitor" / "scene" / "bundled" / "engine" / "meshes"

THROW = 75.5 / 2
ROD = 120.0
CYLINDERS = (-126.0, -42.0, 42.0, 126.0)
MAINS = (-168.0, -84.0, 0.0, 84.0, 168.0)
THROWS_UP = (True, False, False, True)

BORE_RADIUS = 37.010
PISTON_RADIUS = 36.990
BEARING_RADIUS = 22.515
JOURNAL_RADIUS = 22.495
CRANKPIN_RADIUS = 20.995
MOVING_FACETS, FIXED_FACETS = 64, 80

CROWN = 30.5  # above the wrist pin
SKIRT = 20.0  # below it
DECK = THROW + ROD + CROWN + 0.5  # the crown stops half a millimetre below the deck

WEB = 18.0  # thickness of a crank web
JOURNAL = 24.0  # length of a journal and of a crankpin
COUNTERWEIGHT = 65.5
CRANKCASE = 70.0
PAN = -60.0
BAY = 31.0  # half a crankcase bay: a bulkhead clears the webs by 1.0 mm
THRUST = 0.1  # axial clearance at the centre main bearing, which locates the crankshaft


def piston():
    """Return the piston: crown with a dish, three ring grooves, a slipper skirt, a pin bore."""
    land = PISTON_RADIUS - 0.24
    outside = [
        (0.0, -SKIRT), (PISTON_RADIUS - 0.5, -SKIRT), (PISTON_RADIUS, -SKIRT + 1.5),
        (PISTON_RADIUS, 12.2), (33.8, 12.2), (33.8, 15.0), (land, 15.0), (land, 18.0),
        (33.5, 18.0), (33.5, 19.2), (land, 19.2), (land, 23.3), (33.5, 23.3), (33.5, 24.5),
        (land, 24.5), (land, CROWN - 0.6), (land - 0.6, CROWN), (25.0, CROWN),
        (23.5, CROWN - 1.4), (0.0, CROWN - 1.4),
    ]  # fmt: skip
    inside = [
        (0.0, -SKIRT - 1.0), (33.2, -SKIRT - 1.0), (33.2, 4.0), (29.5, 10.0), (29.5, 19.0),
        (26.0, 22.5), (0.0, 22.5),
    ]  # fmt: skip
    cavity = revolve(inside, MOVING_FACETS)
    boss = union(
        along_x(prism(ring(13.0, 64), low, high)) + box((low, -9.0, 0.0), (high, 9.0, 23.5))
        for low, high in ((-36.0, -11.0), (11.0, 36.0))
    )
    body = revolve(outside, MOVING_FACETS) - cavity + (boss ^ revolve(outside, MOVING_FACETS))
    body -= along_x(prism(ring(9.0, 64), -40.0, 40.0))
    for side in (-1.0, 1.0):
        # The skirt touches the bore on the thrust faces only. It is cut back beside the pin, and
        # cut off below the bosses, where the counterweights pass.
        # below the bosses, where the counterweights pass.
        low, high = sorted((side * 31.5, side * 40.0))
        body -= box((low, -40.0, -SKIRT - 1.0), (high, 40.0, 10.5))
        low, high = sorted((side * 20.0, side * 40.0))
        body -= box((low, -40.0, -SKIRT - 1.0), (high, 40.0, -13.5))
    return body


def web():
    """Return one crank web, throw up, in x from 0 to WEB."""
    cheek = along_x(
        (
            prism(ring(26.5, MOVING_FACETS, centre=(0.0, THROW)), 0.0, WEB)
            + prism(ring(31.0, MOVING_FACETS), 0.0, WEB)
        ).hull()
    )
    spread = np.radians(np.linspace(-90.0 - 64.0, -90.0 + 64.0, 9))
    fan = 1.3 * COUNTERWEIGHT * np.column_stack((np.cos(spread), np.sin(spread)))
    fan = np.vstack((fan, [(29.0, 11.0), (-29.0, 11.0)]))
    disc = [
        (0.0, 0.0), (COUNTERWEIGHT - 2.5, 0.0), (COUNTERWEIGHT, 2.5),
        (COUNTERWEIGHT, WEB - 2.5), (COUNTERWEIGHT - 2.5, WEB), (0.0, WEB),
    ]  # fmt: skip
    return (cheek + along_x(prism(fan, 0.0, WEB))) ^ along_x(revolve(disc, MOVING_FACETS))


def crankshaft():
    """Return the crankshaft: five mains, four hollow pins, eight webs, nose and flange."""
    half = JOURNAL / 2
    parts = [
        along_x(prism(ring(JOURNAL_RADIUS, MOVING_FACETS), x - half - 0.5, x + half + 0.5))
        for x in MAINS
    ]
    holes = []
    for x, up in zip(CYLINDERS, THROWS_UP, strict=True):
        pin = ring(CRANKPIN_RADIUS, MOVING_FACETS, centre=(0.0, THROW))
        hollow = ring(8.0, 48, centre=(0.0, THROW))
        cheek = web()
        throw = [
            along_x(prism(pin, -half - 0.5, half + 0.5)),
            cheek.translate((half, 0.0, 0.0)),
            cheek.translate((-half - WEB, 0.0, 0.0)),
        ]
        bored = along_x(prism(hollow, -half - WEB - 0.25, half + WEB + 0.25))
        for made, into in (*((part, parts) for part in throw), (bored, holes)):
            turned = made if up else made.rotate((180.0, 0.0, 0.0))
            into.append(turned.translate((x, 0.0, 0.0)))
    front, rear = MAINS[0] - half, MAINS[-1] + half
    parts += [
        along_x(prism(ring(19.0, 64), front - 22.0, front)),
        along_x(revolve([(0, -45), (12, -45), (14, -43), (14, 1), (0, 1)], 64)).translate(
            (front - 10.0, 0.0, 0.0)
        ),
        along_x(prism(ring(JOURNAL_RADIUS, MOVING_FACETS), rear, rear + 2.0)),
        along_x(prism(ring(38.0, MOVING_FACETS), rear + 1.0, rear + 11.0)),
    ]
    holes += [
        along_x(prism(ring(11.0, 48), rear - 9.0, rear + 12.0)),
        box((front - 50.0, -2.5, 11.0), (front - 26.0, 2.5, 20.0)),
        *(
            along_x(prism(ring(4.5, 24), rear - 1.0, rear + 12.0)).translate(
                (0.0, 29.0 * np.cos(a), 29.0 * np.sin(a))
            )
            for a in np.radians(30.0 + 60.0 * np.arange(6))
        ),
    ]
    return union(parts) - union(holes)


def block():
    """Return the block: open deck, water jacket, deep crankcase, five main bearings."""
    end = MAINS[-1] + JOURNAL / 2
    half = [
        (90.0, PAN), (90.0, PAN + 10.0), (79.0, PAN + 14.0), (79.0, 56.0), (57.0, 92.0),
        (57.0, DECK),
    ]  # fmt: skip
    outline = np.array(half + [(-y, z) for y, z in reversed(half)])
    body = [along_x(prism(outline, -end, end))]
    for x in MAINS:
        x0, x1 = (max(x - 4.0, -end), min(x + 4.0, end))
        body += [box((x0, -88.0, PAN + 5.0), (x1, -74.0, 52.0))]
        body += [box((x0, 74.0, PAN + 5.0), (x1, 88.0, 52.0))]
    body += [along_y(prism(ring(15.0, 48), -95.0, 95.0)).translate((x, 0, 15)) for x in CYLINDERS]
    return union(body) - union([*_crankcase(end), *_cylinders(), *_drillings()]) + _cap_bolts()


def _crankcase(end: float):
    """Yield what is cut out of the block for the crankshaft."""
    yield along_x(prism(ring(BEARING_RADIUS, FIXED_FACETS, around=True), -end - 1.0, end + 1.0))
    for x in CYLINDERS:
        low, high = x - BAY, x + BAY
        low = JOURNAL / 2 - THRUST if x == CYLINDERS[2] else low
        high = THRUST - JOURNAL / 2 if x == CYLINDERS[1] else high
        yield along_x(prism(ring(CRANKCASE, FIXED_FACETS, around=True), low, high))
        yield box((low, -CRANKCASE, PAN - 1.0), (high, CRANKCASE, 0.0))
    for x in MAINS[1:-1]:
        low, high = x - JOURNAL / 2, x + JOURNAL / 2  # the three bearing caps
        yield box((low, -CRANKCASE, PAN - 1.0), (high, CRANKCASE, -44.0))
        yield box((low, -CRANKCASE, -44.5), (high, -50.0, -6.0))
        yield box((low, 50.0, -44.5), (high, CRANKCASE, -6.0))
    for y in (-46.0, 46.0):
        yield along_x(prism(ring(10.0, 40, centre=(y, 44.0)), MAINS[0] + 20.0, MAINS[-1] - 20.0))


def _cylinders():
    """Yield the bores and the water jacket, which is open at the deck."""
    bore = [
        (0.0, 56.0), (BORE_RADIUS, 56.0), (BORE_RADIUS, DECK - 0.5),
        (BORE_RADIUS + 1.5, DECK + 1.0), (0.0, DECK + 1.0),
    ]  # fmt: skip
    cut = revolve(bore, FIXED_FACETS, around=True)
    outer = prism(ring(49.0, MOVING_FACETS), 108.0, DECK + 1.0)
    liner = prism(ring(43.0, MOVING_FACETS), 107.0, DECK + 2.0)
    yield from (cut.translate((x, 0.0, 0.0)) for x in CYLINDERS)
    yield union(outer.translate((x, 0.0, 0.0)) for x in CYLINDERS) - union(
        liner.translate((x, 0.0, 0.0)) for x in CYLINDERS
    )


def _drillings():
    """Yield head bolt holes, pan rail holes, core plugs and engine mount holes."""
    for x in MAINS:
        for y in (-44.0, 44.0):
            yield prism(ring(5.0, 32, centre=(x, y)), DECK - 62.0, DECK + 1.0)
    for x in np.linspace(-170.0, 170.0, 9):
        for y in (-84.5, 84.5):
            yield prism(ring(3.5, 24, centre=(x, y)), PAN - 1.0, PAN + 16.0)
    for side in (-1.0, 1.0):
        for x in CYLINDERS:
            low, high = sorted((side * 47.0, side * 58.0))
            yield along_y(prism(ring(16.0, 48, centre=(142.0, x)), low, high))
            low, high = sorted((side * 76.0, side * 96.0))
            yield along_y(prism(ring(5.0, 32, centre=(15.0, x)), low, high))


def _cap_bolts():
    """Return the hexagon heads under the bearing caps."""
    angle = np.radians(60.0 * np.arange(6))
    head = 8.5 * np.column_stack((np.cos(angle), np.sin(angle)))
    return union(
        prism(np.add(head, (x, y)), -52.0, -43.0) for x in MAINS[1:-1] for y in (-34.0, 34.0)
    )


def main() -> None:
    """Write the three meshes and say what they are."""
    MESHES.mkdir(parents=True, exist_ok=True)
    for make in (block, piston, crankshaft):
        made = make()
        path = MESHES / f"{make.__name__}.ply"
        vertices, faces = write_ply(path, made, "millimetres; made by tools/make_engine_scene.py")
        print(
            f"{path.name}: {vertices} vertices, {faces} triangles, "
            f"{made.volume() / 1000:.1f} cm3, genus {made.genus()}, {path.stat().st_size} bytes"
        )


if __name__ == "__main__":
    main()
