"""Runs examples/materials, and checks in its table that each wall is felt as its material is set.

materials.py BUILD_FOLDER EXAMPLE_FOLDER"""

import math
import os
import subprocess
import sys

PUSH = 1.5  # N, of the hand while it strokes
TAP_SPEED = 0.12  # m/s
RENDERED = 5407  # N/m: no contact is steeper in this loop
DAMPING, STEP = 5, 0.02  # N s/m, of the servo; m/s: a step of the encoder, 20 um, in a tick


def check(rows, scene, measure):
    """What is not as it should be, in sentences."""
    wrong = []

    def expect(is_so, sentence):
        if not is_so:
            wrong.append(sentence)

    def share(forces, frequency):  # of the power of what varies, within 5 Hz of this frequency
        power = [amplitude ** 2 for amplitude in measure.spectrum(forces)]
        return sum(power[max(0, frequency - 5):frequency + 6]) / sum(power)

    def roughness(forces):  # N, rms
        mean = sum(forces) / len(forces)
        return math.sqrt(sum((force - mean) ** 2 for force in forces) / len(forces))

    strokes = {material: measure.part(rows, material, "stroke") for material in scene}
    tangential = {material: measure.sliding(stroke)[0] for material, stroke in strokes.items()}
    rings = {material: measure.ring(measure.part(rows, material, "tap"), item["contact"]["stiffness"])
             for material, (item, _) in scene.items()}
    ring_spectra = {material: measure.ring_spectrum(ring) for material, ring in rings.items()}
    highest = measure.RATE / 8  # Hz, of an impact

    for material, (item, surface) in scene.items():
        normal = measure.sliding(strokes[material])[1]
        push, ratio = sum(normal) / len(normal), sum(tangential[material]) / sum(normal)
        expect(abs(push / PUSH - 1) < 0.1, f"{material} is stroked with {push:.2f} N, not {PUSH} N")
        expect(abs(ratio / surface["dynamic_friction"] - 1) < 0.05,
               f"the friction of {material} is {ratio:.3f}, not {surface['dynamic_friction']}")
        if not surface.get("texture"):
            sticks = max(t / n for t, n in zip(strokes[material]["tangential"], strokes[material]["normal"]))
            expect(abs(sticks / surface["static_friction"] - 1) < 0.05,
                   f"{material} sticks up to {sticks:.3f}, not {surface['static_friction']}")
        impact = surface.get("impact")
        if impact:
            # A sine that decays is the strongest a little below its frequency.
            expected = math.sqrt(min(impact["frequency"], highest) ** 2 - (impact["decay"] / (2 * math.pi)) ** 2)
            found = measure.peak(ring_spectra[material])
            expect(abs(found / expected - 1) < 0.05, f"{material} rings at {found} Hz, not {expected:.0f} Hz")

    # What each is told by.
    x = strokes["corduroy"]["x"]
    speed = (x[-1] - x[-380]) / 1000 / (379 / measure.RATE)  # m/s
    texture = scene["corduroy"][1]["texture"]
    expected = speed / (texture["column_width"] * len(texture["heights"][0]))
    found = measure.peak(measure.spectrum(tangential["corduroy"]))
    expect(abs(found / expected - 1) < 0.1, f"the cords come {found} times a second, not {expected:.1f} times")
    expect(share(tangential["corduroy"], found) > 0.9, "corduroy gives more than one tone")

    rough, smooth = roughness(tangential["sandpaper"]), roughness(tangential["ice"])
    expect(rough > 0.04, f"sandpaper is only {rough:.4f} N rough")
    expect(smooth < 0.002, f"ice is {smooth:.4f} N rough")
    strongest = share(tangential["sandpaper"], measure.peak(measure.spectrum(tangential["sandpaper"])))
    expect(strongest < 0.6, f"{100 * strongest:.0f} % of the roughness of sandpaper is one tone")

    loud = max(ring_spectra["metal"][60:])
    for material in ("rubber", "ice"):
        part = max(ring_spectra[material][60:]) / loud
        expect(part < 0.25, f"above 60 Hz {material} rings with {100 * part:.0f} % of what metal does")
    expect(max(map(abs, rings["corduroy"])) < 0.1, "corduroy has an impact")

    # From tick to tick the force changes by what the way of the hand and an impact explain, and what damps a step of the encoder.
    for before, now in zip(rows, rows[1:]):
        if before["material"] != now["material"]:
            continue  # places are in the frame of the wall
        change = math.dist(*([row[f"sent {axis}"] for axis in "xyz"] for row in (before, now)))
        way = math.dist(*([row[axis] / 1000 for axis in "xyz"] for row in (before, now)))
        explained = RENDERED * way + DAMPING * STEP
        impact = scene[now["material"]][1].get("impact")
        if impact and now["action"] == "tap":
            explained += impact["gain"] * TAP_SPEED * 2 * math.pi * min(impact["frequency"], highest) / measure.RATE
        if change > explained:
            expect(False, f"at {now['time']} s {now['material']} changes by {change:.2f} N in a tick, not {explained:.2f} N")
            break
    return wrong


def main():
    build, example = sys.argv[1:]
    sys.path.insert(0, example)
    import measure
    subprocess.run(["bash", os.path.join(example, "run"), "--built", build], check=True)
    rows = measure.read_table(os.path.join(build, "examples", "materials", "materials.csv"))
    wrong = check(rows, measure.read_scene(os.path.join(example, "materials.json")), measure)
    for sentence in wrong:
        print(f"FAILED: {sentence}")
    print(f"{len(wrong)} failures")
    sys.exit(len(wrong) > 0)


if __name__ == "__main__":
    main()
