//! How strongly an effect acts: from one number, the strength, to the parameters of its law.
//! Strength 1 is near the limit of what six tracks of ten minutes show.

use rand::RngExt;
use serde::Serialize;

use crate::effect::PlumeEffect as E;
use crate::instrument::Faults;
use crate::law;
use crate::physics::{Physics, Wake};
use crate::random::{between, pick, sign, stream};
use crate::scene::Scene;

/// A parameter in the catalogue's words.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrueParameter {
    /// Name, as in the contract.
    pub name: &'static str,
    /// True value.
    pub value: f64,
}

/// Puts `effect` of `strength` into the physics, or into the platforms' faults; gives its
/// parameters (none outside the catalogue). `peak_ppm` is the highest mean excess that the
/// platforms of the effect meet.
pub fn put(
    effect: E,
    strength: f64,
    scene: &Scene,
    seed: u64,
    peak_ppm: f64,
    physics: &mut Physics,
    faults: &mut [&mut Faults],
) -> Vec<TrueParameter> {
    let mut rng = stream(seed, effect.id());
    // All random numbers are drawn before use and do not depend on the strength.
    let draws = Draws {
        sign: sign(&mut rng),
        angle: between(&mut rng, 0.0, std::f64::consts::TAU),
        share: rng.random(),
        other: rng.random(),
        period_s: pick(&mut rng, &[110.0, 150.0, 210.0]),
    };
    if effect.of_a_platform() {
        let mut parameters = Vec::new();
        for faults in faults {
            parameters = sensor(
                effect,
                strength,
                scene,
                &draws,
                peak_ppm,
                physics.other_laws,
                faults,
            );
        }
        return parameters;
    }
    match effect {
        E::WindDirectionOffset
        | E::WindDirectionDrift
        | E::WindSpeedScale
        | E::WindVeerWithHeight
        | E::Meander => transport(effect, strength, &draws, physics),
        E::StabilityClass
        | E::SigmaYScale
        | E::SigmaZScale
        | E::SigmaZGrowth
        | E::EffectiveHeightOffset
        | E::GroundReflection
        | E::MixingLid => spread(effect, strength, scene, &draws, physics),
        E::BackgroundOffset | E::BackgroundDrift | E::BackgroundGradient => {
            background(effect, strength, &draws, physics)
        }
        _ if effect.in_catalogue() => source(effect, strength, scene, &draws, physics),
        _ => {
            outside(effect, strength, scene, &draws, physics);
            Vec::new()
        }
    }
}

struct Draws {
    sign: f64,
    angle: f64,
    share: f64,
    other: f64,
    period_s: f64,
}

fn named<const N: usize>(parameters: [(&'static str, f64); N]) -> Vec<TrueParameter> {
    parameters
        .map(|(name, value)| TrueParameter { name, value })
        .to_vec()
}

fn transport(effect: E, s: f64, draws: &Draws, p: &mut Physics) -> Vec<TrueParameter> {
    match effect {
        E::WindDirectionOffset => {
            p.direction_offset_deg = 0.4 * s * draws.sign;
            named([("offset_deg", p.direction_offset_deg)])
        }
        E::WindDirectionDrift => {
            p.direction_drift_deg_per_h = 6.0 * s * draws.sign;
            named([("rate_deg_per_h", p.direction_drift_deg_per_h)])
        }
        E::WindSpeedScale => {
            p.log_speed = (0.1 * s).min(1.2) * draws.sign;
            named([("factor", p.log_speed.exp())])
        }
        E::WindVeerWithHeight => {
            p.veer_deg_per_100m = 1.2 * s * draws.sign;
            named([("rate_deg_per_100m", p.veer_deg_per_100m)])
        }
        _ => {
            p.meander_deg = 1.6 * s.sqrt();
            named([("sigma_deg", p.meander_deg)])
        }
    }
}

fn spread(effect: E, s: f64, scene: &Scene, draws: &Draws, p: &mut Physics) -> Vec<TrueParameter> {
    match effect {
        E::StabilityClass => {
            // Away from the end of the alphabet that is nearer.
            let side = if scene.class < 3 { 1.0 } else { -1.0 };
            p.class_shift = (0.25 * s).min(3.0) * side;
            named([("shift", p.class_shift)])
        }
        E::SigmaYScale => {
            p.log_sigma_y = (0.06 * s).min(1.5) * draws.sign;
            named([("factor", p.log_sigma_y.exp())])
        }
        E::SigmaZScale => {
            p.log_sigma_z = (0.08 * s).min(1.5) * draws.sign;
            named([("factor", p.log_sigma_z.exp())])
        }
        E::SigmaZGrowth => {
            p.sigma_z_exponent = (0.12 * s).min(1.2) * draws.sign;
            named([("exponent", p.sigma_z_exponent)])
        }
        E::EffectiveHeightOffset => {
            p.axis_offset_m = (2.5 * s * draws.sign).max(-0.8 * scene.axis_m);
            named([("offset_m", p.axis_offset_m)])
        }
        E::GroundReflection => {
            p.reflection = (0.3 * s).min(1.0);
            named([("coefficient", p.reflection)])
        }
        _ => {
            let far = scene.reach.distance_m.1;
            let room = 3.0 * law::sigma_z_m(scene.class as f64, far) / (1.0 + 0.5 * s);
            let lid = scene.axis_m + room;
            p.lid_agl_m = Some(lid);
            named([("height_m", lid)])
        }
    }
}

fn source(effect: E, s: f64, scene: &Scene, draws: &Draws, p: &mut Physics) -> Vec<TrueParameter> {
    let (sin, cos) = draws.angle.sin_cos();
    match effect {
        E::EmissionScale => {
            p.log_emission = (0.12 * s).min(2.0) * draws.sign;
            named([("factor", p.log_emission.exp())])
        }
        E::EmissionTrend => {
            p.trend_per_h = (1.0 * s).min(8.0) * draws.sign;
            named([("rate_per_h", p.trend_per_h)])
        }
        E::SecondSource => {
            // Beside the first, two to five widths of its plume away.
            let width = law::sigma_y_m(scene.class as f64, 0.5 * scene.reach.distance_m.1);
            let (down, across) = scene.wind.from_deg.to_radians().sin_cos();
            let y = draws.sign * width * (2.0 + 3.0 * draws.share);
            let x = (draws.other - 0.7) * 500.0;
            let away = [-down * x - across * y, -across * x + down * y];
            let up = 20.0 * sin;
            let ratio = (0.08 * s).min(1.5);
            p.second = Some((away, ratio, up));
            named([
                ("east_m", away[0]),
                ("north_m", away[1]),
                ("ratio", ratio),
                ("height_offset_m", up),
            ])
        }
        E::SourcePositionOffset => {
            p.shift_m = [10.0 * s * sin, 10.0 * s * cos];
            named([("east_m", p.shift_m[0]), ("north_m", p.shift_m[1])])
        }
        E::FirstOrderDecay => {
            p.decay_per_s = 2e-4 * s;
            named([("rate_per_s", p.decay_per_s)])
        }
        E::DryDeposition => {
            p.deposition_m_s = (0.02 * s).min(4.0);
            named([("velocity_m_s", p.deposition_m_s)])
        }
        _ => {
            p.building_m2 = 600.0 * s;
            named([("area_m2", p.building_m2)])
        }
    }
}

fn background(effect: E, s: f64, draws: &Draws, p: &mut Physics) -> Vec<TrueParameter> {
    match effect {
        E::BackgroundOffset => {
            p.background_ppm = 1.0 * s * draws.sign;
            named([("offset_ppm", p.background_ppm)])
        }
        E::BackgroundDrift => {
            p.background_ppm_per_h = 8.0 * s * draws.sign;
            named([("rate_ppm_per_h", p.background_ppm_per_h)])
        }
        _ => {
            let (sin, cos) = draws.angle.sin_cos();
            p.gradient_ppm_per_km = [0.6 * s * sin, 0.6 * s * cos];
            named([
                ("east_ppm_per_km", p.gradient_ppm_per_km[0]),
                ("north_ppm_per_km", p.gradient_ppm_per_km[1]),
            ])
        }
    }
}

fn sensor(
    effect: E,
    s: f64,
    scene: &Scene,
    draws: &Draws,
    peak_ppm: f64,
    other_laws: bool,
    f: &mut Faults,
) -> Vec<TrueParameter> {
    match effect {
        E::SensorLag => {
            f.lag_s = 0.5 * s;
            f.two_stages = other_laws;
            named([("time_constant_s", f.lag_s)])
        }
        E::SensorGain => {
            // Either calibrated in clean air, or wrong from zero on.
            let from_zero = draws.share < 0.5;
            f.pivot_ppm = from_zero.then_some(0.0);
            let unit = if from_zero { 0.003 } else { 0.05 };
            f.log_gain = (unit * s).min(1.5) * draws.sign;
            let pivot = if from_zero { 0.0 } else { scene.background_ppm };
            named([("factor", f.log_gain.exp()), ("pivot_ppm", pivot)])
        }
        E::SensorOffset => {
            f.offset_ppm = 1.0 * s * draws.sign;
            named([("offset_ppm", f.offset_ppm)])
        }
        E::SensorDrift => {
            f.drift_ppm_per_h = 8.0 * s * draws.sign;
            named([("rate_ppm_per_h", f.drift_ppm_per_h)])
        }
        E::SensorSaturation => {
            let limit = scene.background_ppm + 1.3 * peak_ppm / (1.0 + 0.25 * s);
            f.limit_ppm = Some(limit);
            named([("limit_ppm", limit)])
        }
        _ => environment(effect, s, draws, f),
    }
}

/// Cross-sensitivities, clock and place, and what the catalogue lacks.
fn environment(effect: E, s: f64, draws: &Draws, f: &mut Faults) -> Vec<TrueParameter> {
    let (sin, cos) = draws.angle.sin_cos();
    match effect {
        E::CrossSensitivityHumidity => {
            f.per_percent = 0.12 * s * draws.sign;
            named([
                ("ppm_per_percent", f.per_percent),
                ("reference_percent", 50.0),
            ])
        }
        E::CrossSensitivityTemperature => {
            f.per_k = 0.7 * s * draws.sign;
            named([("ppm_per_k", f.per_k), ("reference_c", 15.0)])
        }
        E::CrossSensitivityPressure => {
            f.per_hpa = 0.15 * s * draws.sign;
            named([("ppm_per_hpa", f.per_hpa), ("reference_hpa", 1013.25)])
        }
        E::ClockOffset => {
            f.clock_s = (0.2 * s * draws.sign).clamp(-20.0, 20.0);
            named([("offset_s", f.clock_s)])
        }
        E::PositionOffset => {
            f.place_m[0] += 5.0 * s * sin;
            f.place_m[1] += 5.0 * s * cos;
            named([("east_m", 5.0 * s * sin), ("north_m", 5.0 * s * cos)])
        }
        E::AltitudeOffset => {
            f.place_m[2] += 3.0 * s * draws.sign;
            named([("offset_m", 3.0 * s * draws.sign)])
        }
        E::SecondSensorDeadTime => {
            f.second_sensor = Some((40.0 + 30.0 * draws.share, (1.0 * s).min(25.0)));
            Vec::new()
        }
        _ => {
            f.waves = Some((1.2 * s, draws.period_s));
            Vec::new()
        }
    }
}

fn outside(effect: E, s: f64, scene: &Scene, draws: &Draws, p: &mut Physics) {
    let class = scene.class as f64;
    let (near, far) = scene.reach.distance_m;
    match effect {
        E::UnlistedChemistry => {
            let at_s = (near * far).sqrt() / scene.wind.speed_m_s;
            p.transient_production = Some((0.12 * s, at_s));
        }
        E::ObstacleWake => {
            let along_m = near + (0.2 + 0.3 * draws.share) * (far - near);
            let width = law::sigma_y_m(class, along_m);
            p.wake = Some(Wake {
                along_m,
                across_m: draws.sign * (0.3 + 0.5 * draws.other) * width,
                width_m: 0.7 * width,
                length_m: 1500.0,
                depth: (0.15 * s).min(1.0),
            });
        }
        E::OnOffEmission => p.on_off = Some(((0.15 * s).min(1.0), 40.0 + 60.0 * draws.share)),
        E::SpreadGrowth => p.spread_growth = Some((0.4 * s * draws.sign, -0.3 * s * draws.sign)),
        E::SkewedProfile => p.skew = (0.6 * s).min(1.0) * draws.sign,
        E::AxisWander => p.unlogged_wander = Some((4.0 * s, 60.0)),
        // From one side to the other once within the record.
        E::WideSwing => p.unlogged_oscillation = Some((15.0 * s, 2.0 * scene.duration_s)),
        E::SlowSwing => p.unlogged_oscillation = Some((0.8 * s, 1.6 * draws.period_s)),
        E::BackgroundWaves => p.background_waves = Some((1.0 * s, draws.period_s)),
        E::BackgroundLayer => {
            let sigma = law::sigma_z_m(class, (near * far).sqrt()).min(scene.axis_m);
            let middle = scene.axis_m + 0.4 * sigma * draws.sign;
            p.layer = Some((1.5 * s * draws.sign, middle, 0.35 * sigma + 8.0));
        }
        _ => p.pulses = Some(((0.15 * s).min(1.0), draws.period_s)),
    }
}
