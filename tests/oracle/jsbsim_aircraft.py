"""An aircraft file of ours (aircraft/*.toml) as a JSBSim aircraft, in a JSBSim root directory.

The aerodynamic functions are written in JSBSim's own terms (wind-axis drag, side and lift;
moments about the centre of gravity), the thrust as an external force along the body's x axis.
Surfaces and motor state come in as properties under `plumage/`. The planet does not rotate and is
so large that it is flat, with the standard gravity of ISO 80000-3 at its surface.
"""
import os
import tomllib

import jsbsim

FT = 0.3048
LBF = 4.4482216152605
SLUG = 14.593902937206
G = 9.80665
RADIUS_M = 1.0e9


def prop(name):
    return f"<property>{name}</property>"


def product(*parts):
    inner = "".join(p if isinstance(p, str) else f"<value>{p!r}</value>" for p in parts)
    return f"<product>{inner}</product>"


def total(*parts):
    return "<sum>" + "".join(p if isinstance(p, str) else f"<value>{p!r}</value>" for p in parts) + "</sum>"


ALPHA, BETA = prop("aero/alpha-rad"), prop("aero/beta-rad")
ELEVATOR, AILERON, RUDDER = (prop(f"plumage/{n}-rad") for n in ("elevator", "aileron", "rudder"))
P_HAT = product(prop("velocities/p-aero-rad_sec"), prop("aero/bi2vel"))
Q_HAT = product(prop("velocities/q-aero-rad_sec"), prop("aero/ci2vel"))
R_HAT = product(prop("velocities/r-aero-rad_sec"), prop("aero/bi2vel"))


def lateral(d):
    return total(
        product(BETA, d["beta"]),
        product(P_HAT, d["p"]),
        product(R_HAT, d["r"]),
        product(AILERON, d["aileron"]),
        product(RUDDER, d.get("rudder", 0.0)),
    )


def longitudinal(d):
    return total(d["zero"], product(ALPHA, d["alpha"]), product(Q_HAT, d["q"]), product(ELEVATOR, d["elevator"]))


def drag(a):
    d = a["drag"]
    square = lambda x: product(x, x)
    terms = [
        d["zero"],
        product(ALPHA, d.get("alpha", 0.0)),
        product(square(ALPHA), d.get("alpha_squared", 0.0)),
        product(BETA, d.get("beta", 0.0)),
        product(square(BETA), d.get("beta_squared", 0.0)),
        product(square(ELEVATOR), d.get("elevator_squared", 0.0)),
    ]
    if "oswald" in d:
        aspect = a["wing"]["span_m"] ** 2 / a["wing"]["area_m2"]
        over = total(longitudinal(a["lift"]), -d.get("min_drag_lift", 0.0))
        terms.append(product(square(over), 1 / (3.141592653589793 * d["oswald"] * aspect)))
    return total(*terms)


def thrust(a):
    p = a["propulsion"]
    v = product(prop("velocities/vt-fps"), FT)
    t = prop("plumage/throttle")
    rho = product(prop("atmosphere/rho-slugs_ft3"), SLUG / FT**3)
    if p.get("law", "blended") == "blended":
        slip = total(v, product(t, total(p["exit_speed_m_s"], product(v, -1.0))))
        square = product(slip, total(slip, product(v, -1.0)))
    else:
        slip = product(t, p["exit_speed_m_s"])
        square = f"<max>{total(product(slip, slip), product(v, v, -1.0))}<value>0.0</value></max>"
    return product(0.5 * p["swept_area_m2"] / LBF, rho, square)


def coefficient(axis, expression, length=None):
    scale = [prop("aero/qbar-psf"), prop("metrics/Sw-sqft")] + ([prop(length)] if length else [])
    return f'<axis name="{axis}"><function name="aero/{axis.lower()}">{product(*scale, expression)}</function></axis>'


def write(root, name, a):
    """Writes aircraft `name` from the parsed TOML `a` under the JSBSim root `root`."""
    b, w = a["body"], a["wing"]
    inertia = SLUG * FT * FT
    text = f"""<?xml version="1.0"?>
<fdm_config name="{name}" version="2.0" release="ALPHA">
<metrics>
 <wingarea unit="M2">{w["area_m2"]!r}</wingarea><wingspan unit="M">{w["span_m"]!r}</wingspan>
 <chord unit="M">{w["chord_m"]!r}</chord>
 <location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location>
</metrics>
<mass_balance negated_crossproduct_inertia="false">
 <ixx unit="SLUG*FT2">{b["ixx_kg_m2"] / inertia!r}</ixx><iyy unit="SLUG*FT2">{b["iyy_kg_m2"] / inertia!r}</iyy>
 <izz unit="SLUG*FT2">{b["izz_kg_m2"] / inertia!r}</izz><ixz unit="SLUG*FT2">{b["ixz_kg_m2"] / inertia!r}</ixz>
 <emptywt unit="LBS">{b["mass_kg"] * G / LBF!r}</emptywt>
 <location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location>
</mass_balance>
<ground_reactions/>
<external_reactions>
 <property>plumage/elevator-rad</property><property>plumage/aileron-rad</property>
 <property>plumage/rudder-rad</property><property>plumage/throttle</property>
 <force name="thrust" frame="BODY"><function>{thrust(a)}</function>
  <location unit="M"><x>0</x><y>0</y><z>0</z></location><direction><x>1</x><y>0</y><z>0</z></direction>
 </force>
</external_reactions>
<aerodynamics>
{coefficient("DRAG", drag(a))}
{coefficient("SIDE", lateral(a["side"]))}
{coefficient("LIFT", longitudinal(a["lift"]))}
{coefficient("ROLL", lateral(a["roll"]), "metrics/bw-ft")}
{coefficient("PITCH", longitudinal(a["pitch"]), "metrics/cbarw-ft")}
{coefficient("YAW", lateral(a["yaw"]), "metrics/bw-ft")}
</aerodynamics>
</fdm_config>
"""
    folder = os.path.join(root, "aircraft", name)
    os.makedirs(folder, exist_ok=True)
    for sub in ("engine", "systems"):
        os.makedirs(os.path.join(root, sub), exist_ok=True)
    with open(os.path.join(folder, name + ".xml"), "w") as out:
        out.write(text)
    with open(os.path.join(root, "flat.xml"), "w") as out:
        out.write(
            f'<planet name="flat"><semimajor_axis unit="M">{RADIUS_M}</semimajor_axis>'
            f'<semiminor_axis unit="M">{RADIUS_M}</semiminor_axis><rotation_rate unit="RAD/SEC">0</rotation_rate>'
            f'<GM unit="M3/SEC2">{G * RADIUS_M**2!r}</GM><J2>0</J2></planet>'
        )


def load(root, toml_path, dt_s, rho_kg_m3):
    """A JSBSim executive with the aircraft of `toml_path`, third-order integrators."""
    with open(toml_path, "rb") as file:
        a = tomllib.load(file)
    name = os.path.splitext(os.path.basename(toml_path))[0]
    write(root, name, a)
    fdm = jsbsim.FGFDMExec(root)
    fdm.set_debug_level(0)
    fdm.load_planet(os.path.join(root, "flat.xml"), False)
    if not fdm.load_model(name):
        raise SystemExit(f"JSBSim does not load {name}")
    fdm.set_dt(dt_s)
    fdm["atmosphere/override/density"] = rho_kg_m3 / (SLUG / FT**3)
    for kind in ("rate/rotational", "rate/translational", "position/rotational", "position/translational"):
        fdm[f"simulation/integrator/{kind}"] = 4
    fdm["simulation/gravity-model"] = 0
    return fdm


def start(fdm, speed, alpha, pitch, heading, surfaces, alt_m=400.0, wind=(0.0, 0.0, 0.0)):
    """Initial conditions: level wings, airspeed (m/s), angles (rad), controls (rad, 0..1)."""
    controls(fdm, surfaces)
    wind_at(fdm, wind)
    fdm["ic/lat-geod-rad"] = 0.0
    fdm["ic/long-gc-rad"] = 0.0
    fdm["ic/h-sl-ft"] = alt_m / FT
    fdm["ic/phi-rad"] = 0.0
    fdm["ic/psi-true-rad"] = heading
    fdm["ic/u-fps"] = 0.0
    fdm["ic/vt-fps"] = speed / FT
    fdm["ic/alpha-rad"] = alpha
    fdm["ic/beta-rad"] = 0.0
    fdm["ic/theta-rad"] = pitch
    fdm.run_ic()


def controls(fdm, surfaces):
    for name, value in zip(("elevator-rad", "aileron-rad", "rudder-rad", "throttle"), surfaces):
        fdm[f"plumage/{name}"] = value


def wind_at(fdm, wind):
    for name, value in zip(("north", "east", "down"), wind):
        fdm[f"atmosphere/wind-{name}-fps"] = value / FT
