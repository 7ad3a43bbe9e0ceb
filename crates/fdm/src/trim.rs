//! Steady flight, and small motions about it.

use nalgebra::{DMatrix, Matrix3, Vector3};

use crate::dynamics::{AirState, Body, Controls, Dynamics, quaternion};
use crate::error::FdmError;
use crate::state::SurfaceCommand;

/// Steady wings-level flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trim {
    /// True airspeed, m/s.
    pub airspeed_m_s: f64,
    /// Air density, kg/m³.
    pub density_kg_m3: f64,
    /// Angle of attack, rad.
    pub alpha_rad: f64,
    /// Pitch angle, rad.
    pub pitch_rad: f64,
    /// Elevator, rad.
    pub elevator_rad: f64,
    /// Throttle, 0 to 1.
    pub throttle: f64,
}

impl Trim {
    /// The command that holds this trim.
    pub fn command(&self) -> SurfaceCommand {
        SurfaceCommand {
            elevator_rad: self.elevator_rad,
            throttle: self.throttle,
            ..SurfaceCommand::default()
        }
    }
}

/// Level flight at an airspeed: the angle of attack, elevator and throttle at which nothing
/// accelerates.
///
/// # Errors
/// [`FdmError::NoTrim`] when the solution lies outside the linear model, the surfaces' travel or
/// the motor's power.
pub fn level(dynamics: &Dynamics, airspeed_m_s: f64, density_kg_m3: f64) -> Result<Trim, FdmError> {
    climb(dynamics, airspeed_m_s, density_kg_m3, 0.0)
}

/// Steady climb along a path elevated by `path_rad` (negative: descent); see [`level`].
///
/// # Errors
/// As [`level`].
pub fn climb(
    dynamics: &Dynamics,
    airspeed_m_s: f64,
    density_kg_m3: f64,
    path_rad: f64,
) -> Result<Trim, FdmError> {
    let refusal = |why: &str| FdmError::NoTrim {
        airspeed_m_s,
        density_kg_m3,
        why: why.to_owned(),
    };
    if !(airspeed_m_s.is_finite() && airspeed_m_s > 0.0 && density_kg_m3 > 0.0) {
        return Err(refusal("airspeed and density must be above 0"));
    }
    let residual = |x: &Vector3<f64>| {
        let body = flying(airspeed_m_s, path_rad, x[0]);
        let controls = Controls {
            elevator: x[1],
            aileron: 0.0,
            rudder: 0.0,
            throttle: x[2],
        };
        let slope = dynamics.derivative(&body, &controls, &calm(density_kg_m3));
        Vector3::new(slope.acc_ned[0], slope.acc_ned[2], slope.rate[1])
    };
    let mut x = Vector3::new(0.05, 0.0, 0.8);
    for _ in 0..50 {
        let r = residual(&x);
        let mut jacobian = Matrix3::zeros();
        for k in 0..3 {
            let mut up = x;
            let mut down = x;
            up[k] += 1e-6;
            down[k] -= 1e-6;
            jacobian.set_column(k, &((residual(&up) - residual(&down)) / 2e-6));
        }
        let step = jacobian
            .lu()
            .solve(&r)
            .ok_or_else(|| refusal("the controls have no effect"))?;
        // Damped Newton: a full step from a poor start would leave the linear range and find a trim
        // beyond stall.
        x -= step.map(|s| s.clamp(-0.2, 0.2));
        if step.norm() < 1e-13 {
            break;
        }
    }
    let left = residual(&x).norm();
    if left.is_nan() || left > 1e-9 {
        return Err(refusal("no equilibrium found"));
    }
    possible(dynamics, &x, path_rad).map_err(refusal)?;
    Ok(Trim {
        airspeed_m_s,
        density_kg_m3,
        alpha_rad: x[0],
        pitch_rad: x[0] + path_rad,
        elevator_rad: x[1],
        throttle: x[2],
    })
}

/// Whether the solution (angle of attack, elevator, throttle) can be flown, else why not.
fn possible(dynamics: &Dynamics, x: &Vector3<f64>, path_rad: f64) -> Result<(), &'static str> {
    let surfaces = &dynamics.aircraft.surfaces;
    if !dynamics.flow_is_valid(x[0], 0.0).0 {
        return Err("the angle of attack is beyond stall");
    }
    if x[1] < surfaces.min_deg.to_radians() || x[1] > surfaces.max_deg.to_radians() {
        return Err("the elevator is at its stop");
    }
    if !(-1e-9..=1.0).contains(&x[2]) && path_rad >= 0.0 {
        return Err("the motor is too weak");
    }
    Ok(())
}

fn calm(density: f64) -> AirState {
    AirState {
        wind_ned: [0.0; 3],
        density,
    }
}

fn flying(airspeed: f64, path: f64, alpha: f64) -> Body {
    Body {
        pos_ned: [0.0; 3],
        vel_ned: [airspeed * path.cos(), 0.0, -airspeed * path.sin()],
        attitude: quaternion(0.0, alpha + path, 0.0),
        rate: [0.0; 3],
    }
}

/// Small motions about a trim: ẋ = A x + B u.
///
/// Longitudinal x = (forward speed u, down speed w, pitch rate q, pitch θ), u = (elevator,
/// throttle); lateral x = (right speed v, roll rate p, yaw rate r, roll φ), u = (aileron, rudder);
/// SI units and radians, body axes.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearModel {
    /// Longitudinal state matrix, 4 × 4.
    pub a_longitudinal: DMatrix<f64>,
    /// Longitudinal input matrix, 4 × 2.
    pub b_longitudinal: DMatrix<f64>,
    /// Lateral state matrix, 4 × 4.
    pub a_lateral: DMatrix<f64>,
    /// Lateral input matrix, 4 × 2.
    pub b_lateral: DMatrix<f64>,
}

/// Derivative of (u, v, w, p, q, r, φ, θ) in body axes for the controls (elevator, aileron,
/// rudder, throttle).
fn body_axes_slope(dynamics: &Dynamics, density: f64, x: &[f64; 8], c: &[f64; 4]) -> [f64; 8] {
    let [u, v, w, p, q, r, roll, pitch] = *x;
    let body = Body {
        pos_ned: [0.0; 3],
        vel_ned: [u, v, w],
        attitude: [1.0, 0.0, 0.0, 0.0],
        rate: [p, q, r],
    };
    let controls = Controls {
        elevator: c[0],
        aileron: c[1],
        rudder: c[2],
        throttle: c[3],
    };
    // With identity attitude the specific force is that of body-axis velocities (u, v, w).
    let slope = dynamics.derivative(&body, &controls, &calm(density));
    let [fx, fy, fz] = slope.specific_force;
    let g = air::STANDARD_GRAVITY_M_S2;
    let (sr, cr) = roll.sin_cos();
    let (sp, cp) = pitch.sin_cos();
    [
        fx - g * sp + r * v - q * w,
        fy + g * cp * sr + p * w - r * u,
        fz + g * cp * cr + q * u - p * v,
        slope.rate[0],
        slope.rate[1],
        slope.rate[2],
        p + (q * sr + r * cr) * sp / cp,
        q * cr - r * sr,
    ]
}

/// Linearises about a trim by central differences.
pub fn linearise(dynamics: &Dynamics, trim: &Trim) -> LinearModel {
    let (v, a) = (trim.airspeed_m_s, trim.alpha_rad);
    let x0 = [
        v * a.cos(),
        0.0,
        v * a.sin(),
        0.0,
        0.0,
        0.0,
        0.0,
        trim.pitch_rad,
    ];
    let c0 = [trim.elevator_rad, 0.0, 0.0, trim.throttle];
    let slope = |x: &[f64; 8], c: &[f64; 4]| body_axes_slope(dynamics, trim.density_kg_m3, x, c);
    // Central differences: the error of rounding and that of curvature are about equal at this
    // step.
    let h = 1e-5;
    let by_state = |k: usize| {
        let (mut up, mut down) = (x0, x0);
        up[k] += h;
        down[k] -= h;
        let (f, g) = (slope(&up, &c0), slope(&down, &c0));
        std::array::from_fn::<f64, 8, _>(|i| (f[i] - g[i]) / (2.0 * h))
    };
    let by_control = |k: usize| {
        let (mut up, mut down) = (c0, c0);
        up[k] += h;
        down[k] -= h;
        let (f, g) = (slope(&x0, &up), slope(&x0, &down));
        std::array::from_fn::<f64, 8, _>(|i| (f[i] - g[i]) / (2.0 * h))
    };
    let states: [[f64; 8]; 8] = std::array::from_fn(by_state);
    let inputs: [[f64; 8]; 4] = std::array::from_fn(by_control);
    let (lon, lat) = ([0, 2, 4, 7], [1, 3, 5, 6]);
    LinearModel {
        a_longitudinal: DMatrix::from_fn(4, 4, |i, j| states[lon[j]][lon[i]]),
        b_longitudinal: DMatrix::from_fn(4, 2, |i, j| inputs[[0, 3][j]][lon[i]]),
        a_lateral: DMatrix::from_fn(4, 4, |i, j| states[lat[j]][lat[i]]),
        b_lateral: DMatrix::from_fn(4, 2, |i, j| inputs[[1, 2][j]][lat[i]]),
    }
}
