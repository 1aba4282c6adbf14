"""Controllers as their own sources and manuals describe them: each reads its file and moves an axis with an error.

Nothing here is shared with the writers. Each function takes the text of a file and the error [arcsec] of the axis in
the controller's counting, where its motor stands [deg], and gives what is left of it [arcsec] along the motion.
"""

import re

import numpy as np

SIDEREAL = 15.041067  # arcsec of the axis in a second of the clock


def linuxcnc(text, kind, error, positions, direction=1):
    """usrmotLoadComp, SET_JOINT_COMP and compute_screw_comp: the trim is added to the commanded position.

    Reading stops at the first line without three numbers; below the first row its trim holds, above the last the last.
    """
    nominal, trims = _linuxcnc_rows(text, kind)
    trim = trims[0 if direction > 0 else 1]
    entry = np.searchsorted(nominal, positions, side="right") - 1
    slope = np.append(np.diff(trim) / np.diff(nominal), 0.0)
    inside = np.maximum(entry, 0)
    added = np.where(entry < 0, trim[0], trim[inside] + slope[inside] * (positions - nominal[inside]))
    return error(positions + added) + 3600 * added


def _linuxcnc_rows(text, kind):
    rows = []
    for line in text.splitlines():
        cells = line[:254].split()[:3]
        try:
            values = [float(cell) for cell in cells]
        except ValueError:
            break
        if len(values) < 3:
            break
        rows.append(values)
    assert 1 < len(rows) <= 256
    nominal, forward, reverse = np.array(rows).T
    assert (np.diff(nominal) > 0).all()  # "compensation values must increase"
    trims = (forward, reverse) if kind else (nominal - forward, nominal - reverse)
    return nominal, [np.float32(each).astype(float) for each in trims]


def linuxcnc_ramped(text, kind, error, speed, *, velocity_limit, acceleration_limit, seconds, period=0.001):
    """The same moving up at a steady speed [deg/s], with the ramp of the correction by the limits of the joint."""
    nominal, (trim, _) = _linuxcnc_rows(text, kind)
    most_v, most_a = 0.5 * velocity_limit, 0.5 * acceleration_limit
    left, ramped, v = [], 0.0, 0.0
    for position in np.arange(0, speed * seconds, speed * period):
        wanted = np.interp(position, nominal, trim)
        way = 1.0 if wanted >= ramped else -1.0
        to_go, dv, speed_now = abs(wanted - ramped), most_a * period, v * way
        stop = 0.5 * (speed_now + dv) ** 2 / most_a
        step = speed_now * period
        if to_go > 0 and to_go <= stop + step:
            if speed_now > dv:
                v, ramped = v - way * dv, ramped + way * (step - 0.5 * dv * period)
            else:
                v, ramped = 0.0, wanted
        elif to_go > 0:
            dv = min(dv, most_v - speed_now)
            more = 0.5 * dv * period
            if to_go > 0.5 * (speed_now + dv) ** 2 / most_a + step + more:
                v, ramped = v + way * dv, ramped + way * (step + more)
            else:
                ramped += way * step
        left.append(error(position + ramped) + 3600 * ramped)
    return np.array(left[len(left) // 4 :])


def twincat_cnc(text, error, positions, direction=1):
    """kw.ssfk: values are actual less programmed position in 0.0001 deg, straight between, taken off the set-point."""
    lines = [line for line in text.splitlines() if line and not line.startswith("# ")]
    fields = {key: int(value) for key, value in (line.split() for line in lines)}
    count = fields["kw.ssfk.kw_nr_max"]
    assert count < 1500 and fields["kw.ssfk.unit"] == 1 and fields["kw.ssfk.interval"] == 0

    def column(name):
        return np.array([fields[f"kw.ssfk.table[{i}].{name}"] for i in range(count)]) * 1e-4

    setpoint, value = column("setpoint"), column("pos" if direction > 0 else "neg")
    assert fields["kw.ssfk.bilateral"] == fields["kw.ssfk.modulo"] == 1
    assert fields["kw.ssfk.kw_startpos"] == round(setpoint[0] * 1e4)
    assert setpoint[-1] - setpoint[0] == 360 and value[0] == value[-1]  # of a modulo axis
    assert len(fields) == 6 + 3 * count
    taken = np.interp(np.mod(positions - setpoint[0], 360) + setpoint[0], setpoint, value)
    return error(positions - taken) - 3600 * taken


def twincat_nc(text, error, positions, direction=1):
    """MC_TableBasedPositionCompensation: even set-points, straight between, additive, by direction, modulo."""
    tables = dict(
        re.findall(r"Table(\w+) : ARRAY\[0\.\.\d+\] OF ST_PositionCompensationTableElement := \[(.*?)\];", text, re.S)
    )
    name = "Both" if "Both" in tables else {1: "Positive", -1: "Negative"}[direction]
    head = re.search(rf"Parameter{name} : ST_PositionCompensationTableParameter := \((.*?)\);", text, re.S)[1]
    found = dict(re.findall(r"(\w+) := ([-\w.]+)", head))
    assert found["Direction"] == f"WorkDirection{name}" and found["Modulo"] == "TRUE"
    place, added = np.array(re.findall(r"Position := ([-\d.]+), Compensation := ([-\d.]+)", tables[name]), float).T
    assert len(place) == int(found["NoOfTableElements"]) and np.ptp(np.diff(place)) < 1e-6
    assert [place[0], place[-1]] == [float(found["MinPosition"]), float(found["MaxPosition"])]
    moved = np.interp(np.mod(positions - place[0], 360) + place[0], place, added)
    return error(positions + moved) + 3600 * moved


def siemens(text, error, positions):
    """$AA_ENC_COMP: even points, straight between, cyclic, added to the actual position that the control reads.

    A positive value moves the axis in negative direction. positions: of the axis as it is read.
    """
    program = [line for line in text.splitlines() if not line.startswith(";")]
    assert program[:2] == ["%_N_AX_EEC_INI", "CHANDATA(1)"] and program[-1] == "M17"
    found = dict(re.fullmatch(r"\$AA_ENC_COMP(.*)=(.*)", line).groups() for line in program[2:-1])
    axis = re.search(r"\[0,(\w+)\]", "".join(found))[1]
    step, start, end = (float(found[f"_{name}[0,{axis}]"]) for name in ("STEP", "MIN", "MAX"))
    assert found[f"_IS_MODULO[0,{axis}]"] == "1" and abs(end - start - 360) < 1e-9
    count = round((end - start) / step)
    value = np.array([float(found[f"[0,{i},{axis}]"]) for i in range(count + 1)])
    assert len(found) == count + 5 and value[0] == value[-1]
    place = np.mod(positions - start, 360) / step
    first = np.minimum(place.astype(int), count - 1)
    return error(positions) - 3600 * (value[first] + (value[first + 1] - value[first]) * (place - first))


def moteus(text, source, output_error, u, turns):
    """MotorPosition: the encoder's reading plus its compensation is what the position loop holds at the command.

    Arguments: output_error [arcsec] of the output, counted as the encoder counts, at readings of the encoder in turns;
    u: turns of the encoder in one of the output; turns: readings of the encoder at which the rotor stands.
    """
    name = f"conf set motor_position.sources.{source}.compensation_"
    lines = text.splitlines()
    assert lines[-1] == "conf write" and all(line.startswith(name) for line in lines[:-1])
    fields = dict(line.removeprefix(name).split() for line in lines[:-1])
    scale = np.float32(fields.pop("scale")) / np.float32(127)
    table = np.array([int(fields[f"table.{i}"]) for i in range(256)])
    assert len(fields) == 256 and np.abs(table).max() <= 127
    ratio = np.mod(turns, 1.0)
    left = np.minimum((ratio * 256).astype(int), 255)
    fraction = (ratio - left / 256) * 256
    compensation = table[left] * scale * (1 - fraction) + table[(left + 1) % 256] * scale * fraction
    actual = turns / u + output_error(turns) / 1_296_000
    return (actual - (turns + compensation) / u) * 1_296_000


def onstepx(text, error, steps_per_degree, worm_steps, worms=3):
    """Pec::poll every 10 ms: an index of sidereal seconds, 0 where the worm is; the row before it is played."""
    per_second = np.float32(steps_per_degree) / np.float32(240)
    seconds = round(worm_steps / per_second)
    assert seconds >= 61
    rows = np.zeros(seconds, dtype=np.int8)
    lines = text.splitlines()
    assert lines[-1] == ":$QZ!#"
    for line in lines[:-1]:
        index, value = re.fullmatch(r":WR(\d+),([+-]\d+)#", line).groups()
        assert -128 <= int(value) <= 127 and int(index) < seconds
        rows[int(index)] = int(value)
    position, rate, index, started, last_index, last_worm, left = 0.0, 0.0, 0, 0, 0, 0, []
    for tick in range(int(worms * worm_steps / per_second * 100)):
        worm = int(position) % worm_steps
        if worm < last_worm:
            index, started = 0, tick
        last_worm = worm
        if tick - started >= 100:
            index, started = index + 1, tick
        index %= seconds
        if index != last_index:
            last_index, row = index, int(rows[index - 1])
            rate = np.clip(row, -round(per_second), round(per_second)) / per_second
        if tick % 50 == 0:
            ideal = tick / 100 * per_second
            left.append(error(position / steps_per_degree) + (position - ideal) * 3600 / steps_per_degree)
        position += 0.01 * per_second * (1 + rate)
    return np.array(left[len(left) // worms :])


def eqmod(text, error, steps_per_degree, worms=3, track_factor=620 * SIDEREAL):
    """Import, CalcRates, GetIdx and PEC_Timer of the northern hemisphere, gain 1 and threshold 0."""
    period, steps, signal, motor = 0, 0, [], []
    for line in text.splitlines()[1:]:  # the first line is not read
        if line.startswith("!WormPeriod="):
            period = int(float(line.partition("=")[2]) + 0.5)
        elif line.startswith("!StepsPerWorm="):
            steps = int(float(line.partition("=")[2]) + 0.5)
        elif not line.startswith("#"):
            _, position, value = line.split()
            motor.append(int(position) % steps)
            signal.append(float(value))
    assert len(signal) == period
    signal = np.array(signal) - np.arange(period) * (signal[-1] - signal[0]) / (period + 1)
    rates = np.append(0.0, -np.diff(signal))
    rates[0] = (rates[-1] + rates[1]) / 2
    rates -= rates.sum() / period
    remainder = 0.0
    for _ in range(3):  # what the mount takes, the rest in the next second
        for i in range(period):
            wanted = SIDEREAL + rates[i] + remainder
            true = track_factor / int(track_factor / wanted + 0.5)
            remainder, rates[i] = wanted - true, true - SIDEREAL
    rates += SIDEREAL
    planned = [motor[0]]
    for rate in rates[:-1]:
        planned.append((planned[-1] + rate * steps_per_degree / 3600) % steps)

    def index_at(position, index):
        where, i = position % steps, 0
        if where > planned[index]:
            while where > planned[index] and i < period:
                index, i = (index + 1) % period, i + 1
            return index
        while where < planned[index] and i < period:
            index, i = (index - 1) % period, i + 1
        return (index + 1) % period

    position, left = 1.0, []
    index, since = index_at(position, 0), 0
    start = position * 3600 / steps_per_degree
    for second in range(worms * period):
        at = position * 3600 / steps_per_degree
        left.append(error(at / 3600) + at - start - second * SIDEREAL)
        position += rates[index] * steps_per_degree / 3600
        index, since = (index + 1) % period, since + 1
        if since >= period:
            index, since = index_at(position, index), 0
    return np.array(left)
