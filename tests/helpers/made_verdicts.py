"""Verdicts of the loop and ground truths of blind cases, as small as a test of scores needs them."""


def truth(*effects, group="single", level=50.0):
    case = {"group": group, "robot": "m900ib700", "setting": "usual", "effects": effects, "levels": [level] * len(effects)}
    return {"campaign": "case_x", "case": case}


def verdict_of(word, *names, alternatives=()):
    return {"verdict": word, "effects": [{"name": name, "alternatives": list(alternatives)} for name in names]}
