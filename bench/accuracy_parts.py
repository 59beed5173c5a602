# SPDX-License-Identifier: Apache-2.0
"""How far the parts of a spacecraft that move, and its actuators, are from closed forms and from what is conserved, by
step and over time."""
from mpmath import mp, mpf

from fledge import flight, world

from bench import closed_forms as exact
from bench.accuracy_motion import HOUR, MINUTE, command, methods
from bench.accuracy_surroundings import fly
from bench.accuracy_table import Section, Table

HEAVY = 1e20    # [kg], [kg m^2] a hub that its parts do not move
SWING = mpf(40) * mp.pi / 180
G0 = mpf("9.80665")


def number(x):
    return mpf(float(x))


def swing(w2, t, start=SWING):
    """theta'' = -w2 sin(theta), from rest at `start`."""
    k = mp.sin(start / 2)
    return 2 * mp.asin(k * mp.ellipfun("cd", mp.sqrt(w2) * mpf(t), m=k * k))


# --- parts that move -------------------------------------------------------------------------------

def panel(method, update, **given):
    """One on a hinge along z; its inertia about its own centre is 2 kg m^2."""
    return fly(method, update, world.HingedPanels(
        mass=10, I_B=[[[1, 0, 0], [0, 1, 0], [0, 0, 2]]], hinge_B=[[1, 0, 0]], axes_B=[[0, 0, 1]], theta=float(SWING),
        **given.pop("panel")), **given)


def angle(sim):
    return number(sim.world.hingedpanels.angles.theta[0])


def closed_forms():
    table = Table("Parts that move: against closed forms, after 10 min", "method, step or tolerance",
                  [("panel on a spring", "rad"), ("panel in a spin", "rad"), ("particle", "m"), ("pendulum", "rad")])
    for name, method, update in methods([0.5, 0.2, 0.1, 0.05, 0.02, 0.01], 1.0):
        figures = []
        # The panel and the body, with the panel's mass in it, turn against each other about their common axis.
        sim = panel(method, update, panel={"stiffness": 0.5}, mass=40, I_B=[10, 10, 12])
        sim.run(10 * MINUTE)
        body = 12 + mpf(40 * 10) / (40 + 10)
        figures.append(abs(angle(sim) - SWING * mp.cos(mp.sqrt((1 / mpf(2) + 1 / body) / 2) * 600)))

        # J theta'' = -m h d Omega^2 sin(theta)
        sim = panel(method, update, panel={"center_B": [[1.5, 0, 0]]}, mass=HEAVY, I_B=[HEAVY] * 3,
                    omega_BN_B=[0, 0, 0.5])
        sim.run(10 * MINUTE)
        figures.append(abs(angle(sim) - swing(mpf(10) * 1 * 1.5 * mpf(0.5)**2 / (2 + 10 * mpf(1.5)**2), 600)))

        # A damped oscillation of the reduced mass.
        sim = fly(method, update, world.FuelSlosh(mass=5, r_B=[[0.2, 0, 0]], axes_B=[[1, 0, 0]], stiffness=1.0,
                                                  damping=0.01, rho=0.1), mass=20)
        sim.run(10 * MINUTE)
        mu = mpf(5 * 20) / (5 + 20)
        decay, w = number(0.01) / (2 * mu), mp.sqrt(1 / mu - (number(0.01) / (2 * mu))**2)
        rho = number(0.1) * mp.exp(-decay * 600) * (mp.cos(w * 600) + decay / w * mp.sin(w * 600))
        figures.append(abs(number(sim.world.fuelslosh.fuel.r_B[0][0]) - number(0.2) - rho))

        # Thrust along -x is a weight along x: theta'' = -a / l sin(theta).
        sim = fly(method, update, world.SloshPendulum(
            mass=5, length=0.75, r_B=[[0, 0, 0]], rod_B=[[float(mp.cos(SWING)), float(mp.sin(SWING)), 0]]),
            mass=HEAVY, I_B=[HEAVY] * 3)
        sim.world.craft.external.force_B = [-0.5 * HEAVY, 0, 0]
        sim.world.craft.external.head.quality = "GOOD"
        sim.run(10 * MINUTE)
        r = exact.vector(sim.world.sloshpendulum.fuel.r_B[0])
        figures.append(abs(mp.atan2(r[1], r[0]) - swing(mpf(0.5) / mpf(0.75), 600)))
        table.add(name, *figures)
    return table


HUB = [[30, 1, 2], [1, 40, -1], [2, -1, 50]]
PANEL = [[1, 0, 0.1], [0, 2, 0], [0.1, 0, 1.5]]


def assembly(method, update):
    """Three wheels, two panels, a particle and a pendulum on a body that tumbles."""
    return fly(
        method, update,
        world.ReactionWheels(axes_B=[[1, 0, 0], [0, 1, 0], [0.6, 0, 0.8]], J=0.1, Omega=[20, -30, 10]),
        world.HingedPanels(mass=[6, 4], I_B=[PANEL, PANEL], hinge_B=[[0.5, 0.2, 0], [-0.4, 0, 0.3]], stiffness=[5, 8],
                           axes_B=[[0, 1, 0], [1, 0, 0]], center_B=[[0.8, 0, 0.1], [0, 0.7, 0]], theta=[0.3, -0.2]),
        world.FuelSlosh(mass=3, r_B=[[0.1, -0.2, 0.3]], axes_B=[[0.8, 0.6, 0]], stiffness=4, rho=0.05),
        world.SloshPendulum(mass=2, length=0.4, r_B=[[0, 0.1, -0.3]], rod_B=[[0, 0, 1]], spin_B=[[0.3, 0.2, 0]]),
        mass=80, I_B=HUB, center_B=[0.05, -0.1, 0.02], omega_BN_B=[0.2, -0.1, 0.15], v_BN_N=[1, -2, 0.5])


def sums(w):
    """Momentum, angular momentum about the centre of mass (N components) and energy, over all bodies."""
    state, panels = w.craft.state, w.hingedpanels
    to_N = exact.transpose(exact.dcm(exact.vector(state.sigma_BN)))
    omega, v0 = exact.vector(state.omega_BN_B), exact.times(exact.transpose(to_N), exact.vector(state.v_BN_N))
    none = [mpf(0)] * 3
    bodies = [(80, exact.vector(w.craft.center_B), none, omega, [exact.vector(row) for row in HUB])]
    energy = mpf(0)
    for i in range(2):
        g, theta = exact.vector(panels.axes_B[i]), number(panels.angles.theta[i])
        turn, rate = exact.rotation(exact.scale(theta, g)), exact.scale(number(panels.angles.dtheta[i]), g)
        arm = exact.times(turn, exact.vector(panels.center_B[i]))
        inertia = exact.product(exact.product(turn, [exact.vector(row) for row in PANEL]), exact.transpose(turn))
        bodies.append((number(panels.mass[i]), exact.add(exact.vector(panels.hinge_B[i]), arm), exact.cross(rate, arm),
                       exact.add(omega, rate), inertia))
        energy += number(panels.stiffness[i]) * theta**2 / 2
    for part in (w.fuelslosh, w.sloshpendulum):
        bodies.append((number(part.mass[0]), exact.vector(part.fuel.r_B[0]), exact.vector(part.fuel.v_B[0]), none,
                       [none] * 3))
    spring = exact.add(exact.vector(w.fuelslosh.fuel.r_B[0]), exact.vector(w.fuelslosh.r_B[0]), -1)
    energy += number(w.fuelslosh.stiffness[0]) * exact.dot(spring, spring) / 2

    mass, moment, linear, angular = mpf(0), none, none, none    # about B's origin, B components
    for m, r, rate, spin, inertia in bodies:
        v = exact.add(exact.add(v0, exact.cross(omega, r)), rate)
        turning = exact.times(inertia, spin)
        mass, moment, linear = mass + m, exact.add(moment, r, m), exact.add(linear, v, m)
        angular = exact.add(exact.add(angular, exact.cross(r, v), m), turning)
        energy += (m * exact.dot(v, v) + exact.dot(spin, turning)) / 2
    for axis, J, Omega in zip(w.reactionwheels.axes_B, w.reactionwheels.J, w.reactionwheels.speeds.Omega):
        g = exact.scale(1 / exact.norm(exact.vector(axis)), exact.vector(axis))
        h = number(J) * (exact.dot(g, omega) + number(Omega))
        angular, energy = exact.add(angular, g, h), energy + h * h / (2 * number(J))
    angular = exact.add(angular, exact.cross(moment, linear), -1 / mass)
    return exact.times(to_N, linear), exact.times(to_N, angular), energy


def conservation():
    table = Table("Wheels, panels and fuel on a tumbling body", "method, step or tolerance",
                  [(f"{what} after {t} min", "relative") for t in (1, 10) for what in ("angular momentum", "energy")]
                  + [("momentum", "relative")])
    for name, method, update in methods([0.5, 0.2, 0.1, 0.05, 0.02], 1.0):
        sim = assembly(method, update)
        (linear, angular, energy), figures = sums(sim.world), []
        for t in (MINUTE, 10 * MINUTE):
            sim.run(until=t)
            now = sums(sim.world)
            figures += [exact.relative(now[1], angular), abs(now[2] / energy - 1)]
        table.add(name, *figures, exact.relative(now[0], linear))
    return table


def jitter():
    table = Table("Imbalanced wheels: coupled and simple, RK4 at 1 ms, after 1 s", "unbalance [kg m], couple [kg m^2]",
                  [("rate by simple jitter", "rad/s"), ("difference of the coupled model", "relative")])
    for size in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5):
        rates = []
        for simple in (0, 1):
            sim = fly(world.RK4(), 0.001, world.ReactionWheels(
                axes_B=[[0, 0, 1]], J=0.1, Omega=60, unbalance=size, couple=size / 10, r_WB_B=[[0.3, 0, 0.2]],
                jitter=simple), I_B=[10, 12, 15])
            sim.run(1)
            rates.append(exact.vector(sim.world.craft.state.omega_BN_B))
        table.add(f"{size:.0e}, {size / 10:.0e}".replace("e-0", "e-"), exact.norm(rates[1]), exact.relative(*rates))
    return table


def moving():
    return Section(
        "Parts that move",
        "closed forms of single parts, the conservation of momentum and energy of all together, and the cheap model of"
        " imbalanced wheels, which leaves out the second order.",
        "All begin at 40 deg or 0.1 m. The panel in the spin of 0.5 rad/s, and the pendulum under thrust, swing as "
        "pendulums do, in Jacobi's elliptic functions; the particle oscillates with the reduced mass, damped.",
        closed_forms(),
        "Three wheels, two panels on springs, a particle and a pendulum, all off the centre of a body that tumbles at "
        "0.27 rad/s; the sums are over the bodies, from their published places and rates.",
        conservation(),
        "One wheel of 60 rad/s off the centre of a body of 100 kg.",
        jitter())


# --- actuators -------------------------------------------------------------------------------------

def rocket():
    """v = c log(m0 / m) until the tanks are empty."""
    F, isp, dry, fuel = 50.0, 220.0, 100.0, 40.0
    c = number(isp) * G0
    table = Table("Thrusters: the rocket equation", "method, step or tolerance",
                  [("speed after 10 min", "relative"), ("speed, tanks empty", "relative"),
                   ("propellant after 10 min", "relative")])
    for name, method, update in methods([100.0, 50.0, 20.0, 10.0, 1.0], 10.0):
        sim = fly(method, update, world.Thrusters(r_TB_B=[[0, 0, -1]], axes_B=[[0, 0, 1]], F=F, isp=isp,
                                                  r_KB_B=[[0, 0, 0.3]], propellant=fuel), mass=dry)
        thrusters = sim.world.thrusters
        thrusters.valves.open[0], thrusters.valves.head.quality = 1, "GOOD"
        figures = []
        for t, used in ((600, mpf(F) / c * 600), (2000, mpf(fuel))):
            sim.run(until=t)
            speed = c * mp.log((dry + fuel) / (dry + fuel - used))
            figures.append(abs(number(sim.world.craft.state.v_BN_N[2]) / speed - 1))
            if t == 600:
                burnt = abs(number(thrusters.output.used) / used - 1)
        table.add(name, *figures, burnt)
    return table


def spun():
    """What expels propellant from a spinning body carries the angular momentum of its place away."""
    F, isp, fuel, radius, rate = 0.1, 200.0, 50.0, 0.3, 0.03
    corners = [[x, y, -0.5] for x in (-1, 1) for y in (-1, 1)] * 2
    flow = 8 * number(F) / (number(isp) * G0)
    wanted = number(rate) * exact.jet_damping(800, mp.sqrt(2), flow, number(fuel), number(radius), 1000)
    table = Table("Thrusters: jet damping, after 1,000 s", "method, step or tolerance", [("rate", "relative")])
    for name, method, update in methods([100.0, 10.0, 1.0, 0.1], 10.0):
        sim = fly(method, update, world.Thrusters(r_TB_B=corners, axes_B=[[0, 0, 1]] * 8, F=F, isp=isp,
                                                  r_KB_B=[[0, 0, 0.2]], propellant=fuel, radius=radius,
                                                  shape="SHRINKS"),
                  mass=750, I_B=[700, 700, 800], omega_BN_B=[0, 0, rate])
        valves = sim.world.thrusters.valves
        valves.open[:8], valves.head.quality = 1, "GOOD"
        sim.run(1000)
        table.add(name, abs(number(sim.world.craft.state.omega_BN_B[2]) / wanted - 1))
    return table


def pulses():
    """F (top (d - rise min(top, 1) / 2) + top^2 fall / 2), top = min(d / rise, 1), for a pulse of d."""
    F, rise, fall, n = 22.0, 40_000_000, 70_000_000, 20
    table = Table("Thrusters: 20 pulses of 7 to 140 ms with ramps", "RK4, period of the task",
                  [("worst impulse", "relative"), ("speed at the end", "relative")])
    for update in (10.0, 1.0, 0.1, 0.01):
        sim = fly(world.RK4(), update, world.Thrusters(axes_B=[[1, 0, 0]], F=F, rise=rise, fall=fall))
        thrusters, worst, total, before = sim.world.thrusters, mpf(0), mpf(0), mpf(0)
        for k in range(n):
            begin, d = 10_000_000_000 * k + 123_456_789 * (k + 1), 7_000_000 * (k + 1)
            thrusters.times.on[0], thrusters.times.off[0], thrusters.times.head.quality = begin, begin + d, "GOOD"
            sim.run(until=10.0 * (k + 1))
            top = min(mpf(d) / rise, mpf(1))
            wanted = mpf(F) * (top * (d - mpf(min(d, rise)) / 2) + top * top * fall / 2) / 10**9
            impulse = number(thrusters.output.impulse[0])
            worst, before, total = max(worst, abs((impulse - before) / wanted - 1)), impulse, total + wanted
        table.add(f"{update:g} s", worst, abs(number(sim.world.craft.state.v_BN_N[0]) * 100 / total - 1))
    return table


def compass():
    """A rod in a constant field is a pendulum: I theta'' = -m B sin(theta)."""
    strength, r, m, inertia = 7.8e15, 7e6, 100.0, 10.0
    table = Table("Torque rods: the angle of a compass needle", "method, step or tolerance",
                  [(f"after {name}", "rad") for name in ("1 h", "10 h")])
    for name, method, update in methods([30.0, 10.0, 5.0, 2.0, 1.0], 10 * MINUTE):
        field = world.Magnetism(body=world.EARTH, dipole_P=[0, 0, -strength])
        sim = fly(method, update, world.TorqueRods(axes_B=[[0, 0, 1]], field=field), sources=[("field", field)],
                  I_B=[inertia] * 3, r_BN_N=[r, 0, 0], sigma_BN=[float(mp.tan(SWING / 4)), 0, 0])
        rods = sim.world.torquerods
        rods.command.dipole[0], rods.command.head.quality = m, "GOOD"
        figures = []
        for t in (HOUR, 10 * HOUR):
            sim.run(until=t)
            theta = swing(mpf(m) * mpf(strength) / mpf(r)**3 / mpf(inertia), t)
            wanted = exact.transpose(exact.rotation([theta, mpf(0), mpf(0)]))
            figures.append(exact.angle_between(exact.dcm(exact.vector(sim.world.craft.state.sigma_BN)), wanted))
        table.add(name, *figures)
    return table


def momentum(w, I_B):
    """Of body and gyros, N components."""
    gyros, omega = w.controlmomentgyros, exact.vector(w.craft.state.omega_BN_B)
    total = exact.times([exact.vector(row) for row in I_B], omega)
    for i in range(4):
        g, s0 = exact.vector(gyros.gimbal_axes_B[i]), exact.vector(gyros.spin_axes_B[i])
        g = exact.scale(1 / exact.norm(g), g)
        s0 = exact.add(s0, g, -exact.dot(s0, g))
        s = exact.times(exact.rotation(exact.scale(number(gyros.gimbals.angle[i]), g)),
                        exact.scale(1 / exact.norm(s0), s0))
        t = exact.cross(g, s)
        for axis, J, rate in ((s, gyros.J[i], gyros.speeds.Omega[i]), (s, gyros.J_s[i], 0), (t, gyros.J_t[i], 0),
                              (g, gyros.J_g[i], gyros.gimbals.rate[i])):
            total = exact.add(total, axis, number(J) * (exact.dot(axis, omega) + number(rate)))
    return exact.times(exact.transpose(exact.dcm(exact.vector(w.craft.state.sigma_BN))), total)


def gyros():
    table = Table("Control moment gyros: total momentum", "method, step or tolerance",
                  [(f"after {t} min", "relative") for t in (1, 10, 60)])
    I_B = [[50, 0, 0], [0, 60, 0], [0, 0, 80]]
    for name, method, update in methods([1.0, 0.5, 0.2, 0.1, 0.05, 0.02], 1.0):
        sim = fly(method, update, world.ControlMomentGyros(
            gimbal_axes_B=flight.PYRAMID, spin_axes_B=[[0, 1, 0], [-1, 0, 0], [0, -1, 0], [1, 0, 0]], J=0.05, J_g=0.08,
            J_s=0.01, J_t=0.05, Omega=150, lag=0.5), I_B=I_B, sigma_BN=[0.1, 0.2, -0.3], omega_BN_B=[0.02, -0.03, 0.01])
        sim.reset()
        before, figures = momentum(sim.world, I_B), []
        for t in range(0, 3600, 10):
            rates = sim.world.controlmomentgyros.rates
            rates.rate[:4] = [0.05 * ((t // 10 * k) % 7 - 3) / 3 for k in (1, 2, 3, 5)]
            rates.head.quality = "GOOD"
            command(sim.world.controlmomentgyros, [0.01 * ((t // 10 * k) % 5 - 2) for k in (5, 3, 2, 1)])
            sim.run(10)
            if t + 10 in (60, 600, 3600):
                figures.append(exact.relative(momentum(sim.world, I_B), before))
        table.add(name, *figures)
    return table


def actuators():
    return Section(
        "Actuators",
        "the rocket equation, the jet damping of a spin, the impulse of a pulse, the swing of a rod in a constant "
        "field, and the conservation of momentum with gyros whose gimbals turn.",
        "40 kg of propellant in 140 kg, 50 N at 220 s: after 1726 s the tanks are empty.",
        rocket(),
        "Eight jets of 0.1 N at 200 s, along the axis about which 750 kg spin at 0.03 rad/s; 50 kg of propellant in a "
        "ball that shrinks. The flow takes the angular momentum of its nozzle along: the rate changes by "
        "-9.8651537619e-4 of itself.",
        spun(),
        "Thrust rises in 40 ms and falls in 70 ms. Steps end where a valve moves or a ramp ends, to the nanosecond, so"
        " that the period of the task does not matter.",
        pulses(),
        "A dipole of 100 A m^2 in 23 uT, 10 kg m^2, from rest at 40 deg: a period of 425 s.",
        compass(),
        "Four gyros of 7.5 N m s; every 10 s gimbals and wheels get other commands.",
        gyros())
