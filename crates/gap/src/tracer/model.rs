//! What a model says of an arc: crosswind-integrated concentration, width and vertical spread,
//! from Briggs' open-country spread with named changes.

use plume::sigma::{self, Setting};
use plume::stability::Stability;

use super::arcs::{Arc, Weather};
use super::surface_layer;

/// Distance at which a change of growth changes nothing, m: the geometric middle of the arcs of
/// most field trials. The catalogue's pivot of 1 km is applied when a finding is written down.
pub const PIVOT_M: f64 = 200.0;

/// A change of the vertical model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Vertical {
    /// The wind at 0.6 of the plume's mean height instead of that at the anemometer.
    PlumeWind,
    /// σ_z between the classes' curves by 1/L, instead of the class's own.
    Continuum,
    /// σ_z by a factor.
    Scale,
    /// σ_z by a factor and a power of distance.
    Growth,
    /// Loss at the ground.
    Deposition,
    /// Loss everywhere at a constant rate.
    Decay,
    /// The release by a factor.
    Emission,
}

/// A change of the lateral model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Lateral {
    /// σ_y = σ_azimuth x f(x) instead of Briggs'.
    Azimuth,
    /// σ_y by a factor.
    Scale,
    /// σ_y by a factor and a power of distance.
    Growth,
}

/// A parameter's prior: normal about 0, or its positive half.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Prior {
    /// Name in the report.
    pub name: &'static str,
    /// Standard deviation.
    pub sd: f64,
    /// Only values from 0 on.
    pub positive: bool,
}

const fn prior(name: &'static str, sd: f64) -> Prior {
    Prior {
        name,
        sd,
        positive: false,
    }
}

impl Vertical {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::PlumeWind,
        Self::Continuum,
        Self::Scale,
        Self::Growth,
        Self::Deposition,
        Self::Decay,
        Self::Emission,
    ];

    /// Its id in `gap.json`.
    pub fn id(self) -> &'static str {
        match self {
            Vertical::PlumeWind => "wind-at-plume-height",
            Vertical::Continuum => "spread-by-obukhov-length",
            Vertical::Scale => "sigma-z-scale",
            Vertical::Growth => "sigma-z-growth",
            Vertical::Deposition => "dry-deposition",
            Vertical::Decay => "first-order-decay",
            Vertical::Emission => "emission-scale",
        }
    }

    /// Its parameters. Spread is known to a third or so (Pasquill & Smith 1983). Deposition
    /// velocities of SO2 and gases like it on grass are about 1 cm/s (Sehmel 1980), the
    /// mean of their half-normal prior. SO2 is
    /// oxidised in the gas phase at 0.5 to 5 % an hour, in fog up to ten times faster
    /// (Seinfeld & Pandis 2006, chapter 7), so a decay that would show within a kilometre is
    /// chemically absurd.
    pub fn priors(self) -> &'static [Prior] {
        match self {
            Vertical::PlumeWind | Vertical::Continuum => &[],
            Vertical::Scale | Vertical::Emission => const { &[prior("ln_factor", 0.35)] },
            Vertical::Growth => const { &[prior("ln_factor", 0.35), prior("exponent", 0.3)] },
            Vertical::Deposition => {
                const {
                    &[Prior {
                        name: "velocity_m_s",
                        sd: 0.0125,
                        positive: true,
                    }]
                }
            }
            Vertical::Decay => {
                const {
                    &[Prior {
                        name: "rate_per_s",
                        sd: 3e-5,
                        positive: true,
                    }]
                }
            }
        }
    }
}

impl Lateral {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Azimuth, Self::Scale, Self::Growth];

    /// Its id in `gap.json`.
    pub fn id(self) -> &'static str {
        match self {
            Lateral::Azimuth => "sigma-y-from-azimuth",
            Lateral::Scale => "sigma-y-scale",
            Lateral::Growth => "sigma-y-growth",
        }
    }

    /// Its parameters.
    pub fn priors(self) -> &'static [Prior] {
        match self {
            Lateral::Azimuth => &[],
            Lateral::Scale => const { &[prior("ln_factor", 0.35)] },
            Lateral::Growth => const { &[prior("ln_factor", 0.35), prior("exponent", 0.3)] },
        }
    }
}

/// The numbers behind a list of vertical changes.
#[derive(Debug, Clone, Copy, Default)]
struct VerticalNumbers {
    plume_wind: bool,
    continuum: bool,
    log_factor: f64,
    exponent: f64,
    deposition_m_s: f64,
    decay_per_s: f64,
    log_release: f64,
}

impl VerticalNumbers {
    fn of(changes: &[Vertical], theta: &[f64]) -> Self {
        let mut numbers = Self::default();
        let mut rest = theta.iter().copied();
        let mut next = || rest.next().unwrap_or(0.0);
        for change in changes {
            match change {
                Vertical::PlumeWind => numbers.plume_wind = true,
                Vertical::Continuum => numbers.continuum = true,
                Vertical::Scale => numbers.log_factor += next(),
                Vertical::Growth => {
                    numbers.log_factor += next();
                    numbers.exponent += next();
                }
                Vertical::Deposition => numbers.deposition_m_s += next(),
                Vertical::Decay => numbers.decay_per_s += next(),
                Vertical::Emission => numbers.log_release += next(),
            }
        }
        numbers
    }

    fn sigma_z_m(&self, weather: &Weather, x_m: f64) -> f64 {
        let briggs = if self.continuum {
            between_classes_m(x_m, weather.class_position)
        } else {
            sigma::sigma_z_m(x_m, weather.class, Setting::Rural)
        };
        let changed = briggs * (self.log_factor + self.exponent * (x_m / PIVOT_M).ln()).exp();
        // A plume mixed through the layer grows no more.
        changed.min(weather.mixing_height_m.map_or(f64::INFINITY, |zi| 0.8 * zi))
    }

    /// Transport speed of a plume with `sigma_z_m`, m/s: that at 0.6 of its mean height
    /// √(2/π) σ_z (van Ulden 1978).
    fn speed_m_s(&self, weather: &Weather, sigma_z_m: f64) -> f64 {
        if self.plume_wind {
            let mean_height = (2.0 / std::f64::consts::PI).sqrt() * sigma_z_m;
            let height = mean_height.max(weather.source_height_m);
            surface_layer::wind_speed_m_s(weather, 0.6 * height)
        } else {
            weather.wind_speed_m_s
        }
    }

    /// ln of the part still airborne at `x_m`: source depletion with full reflection, and decay.
    fn log_airborne(&self, weather: &Weather, x_m: f64) -> f64 {
        let mut log = -self.decay_per_s * x_m / weather.wind_speed_m_s;
        if self.deposition_m_s != 0.0 {
            const STEPS: usize = 16;
            let ratio = (x_m).powf(1.0 / STEPS as f64);
            let mut integral = 0.0;
            for k in 0..STEPS {
                let x = ratio.powf(k as f64 + 0.5);
                let sigma = self.sigma_z_m(weather, x);
                let bell = (-0.5 * (weather.source_height_m / sigma).powi(2)).exp();
                let ground = (2.0 / std::f64::consts::PI).sqrt() * bell
                    / (sigma * self.speed_m_s(weather, sigma));
                integral += ground * x * ratio.ln();
            }
            log -= self.deposition_m_s * integral;
        }
        log
    }
}

/// Briggs' σ_z in m between the curves of two classes, even in the logarithm.
fn between_classes_m(x_m: f64, position: f64) -> f64 {
    let below = (position.floor() as usize).min(Stability::ALL.len() - 2);
    let share = position - below as f64;
    let log = |class: usize| sigma::sigma_z_m(x_m, Stability::ALL[class], Setting::Rural).ln();
    ((1.0 - share) * log(below) + share * log(below + 1)).exp()
}

/// ln of σ_z in m at `x_m`.
pub fn log_sigma_z(weather: &Weather, x_m: f64, changes: &[Vertical], theta: &[f64]) -> f64 {
    VerticalNumbers::of(changes, theta)
        .sigma_z_m(weather, x_m)
        .ln()
}

/// ln of the crosswind-integrated concentration in mg/m² on an arc, with the ground reflecting.
pub fn log_integrated(weather: &Weather, arc: &Arc, changes: &[Vertical], theta: &[f64]) -> f64 {
    let numbers = VerticalNumbers::of(changes, theta);
    let sigma = numbers.sigma_z_m(weather, arc.distance_m);
    let speed = numbers.speed_m_s(weather, sigma);
    let bell = |z: f64| (-0.5 * (z / sigma).powi(2)).exp();
    let (z, h) = (arc.height_m, weather.source_height_m);
    let vertical = (bell(z - h) + bell(z + h)).max(1e-300);
    let root = (2.0 * std::f64::consts::PI).sqrt();
    (weather.release_mg_s * vertical / (root * speed * sigma)).ln()
        + numbers.log_release
        + numbers.log_airborne(weather, arc.distance_m)
}

/// ln of the peak of a normal distribution across, from the logarithms of its integral and width.
pub fn log_peak(log_integrated: f64, log_width: f64) -> f64 {
    log_integrated - log_width - 0.5 * (2.0 * std::f64::consts::PI).ln()
}

/// Pasquill's (1976) universal f(x) in σ_y = σ_azimuth x f(x), in the form 1/(1 + .0308 x^.4548)
/// that Irwin (1979) gave it; x in m, up to 10 km.
fn pasquill_f(x_m: f64) -> f64 {
    1.0 / (1.0 + 0.0308 * x_m.powf(0.4548))
}

/// ln of the width in m of an arc; `None` where the azimuth's deviation is called for and not
/// known.
pub fn log_width(weather: &Weather, x_m: f64, changes: &[Lateral], theta: &[f64]) -> Option<f64> {
    let mut log = if changes.contains(&Lateral::Azimuth) {
        (weather.sigma_azimuth_rad? * x_m * pasquill_f(x_m)).ln()
    } else {
        sigma::sigma_y_m(x_m, weather.class, Setting::Rural).ln()
    };
    let mut rest = theta.iter().copied();
    let mut next = || rest.next().unwrap_or(0.0);
    for change in changes {
        match change {
            Lateral::Azimuth => {}
            Lateral::Scale => log += next(),
            Lateral::Growth => log += next() + next() * (x_m / PIVOT_M).ln(),
        }
    }
    Some(log)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weather() -> Weather {
        Weather {
            trial: "t".into(),
            release_mg_s: 1e5,
            source_height_m: 0.46,
            wind_speed_m_s: 5.0,
            wind_height_m: 2.0,
            obukhov_length_m: -30.0,
            roughness_m: 0.006,
            mixing_height_m: None,
            sigma_azimuth_rad: Some(0.2),
            wind_from_deg: None,
            class: Stability::C,
            class_position: 2.0,
        }
    }

    fn at(distance_m: f64) -> Arc {
        Arc {
            distance_m,
            height_m: 1.5,
            samplers: 20,
            bearing_deg: 0.0,
            max_mg_m3: 1.0,
            integrated_mg_m2: 1.0,
            width_m: 1.0,
            whole: true,
        }
    }

    // By hand: class C at 100 m, σz = 8/√1.02 = 7.92118; (2·1e5)/(√2π·5·7.92118) = 2014.6, times
    // the mean of the two bells at 1.04 and 1.96 m (.99142 and .96984) gives 1975.6 mg/m².
    #[test]
    fn integrated_by_hand() {
        let got = log_integrated(&weather(), &at(100.0), &[], &[]).exp();
        assert!((got / 1975.6 - 1.0).abs() < 1e-3, "{got}");
    }

    #[test]
    fn changes_have_the_right_sense() {
        let w = weather();
        let base = |x| log_integrated(&w, &at(x), &[], &[]);
        let with = |x, c: Vertical, t: &[f64]| log_integrated(&w, &at(x), &[c], t) - base(x);
        assert!(with(800.0, Vertical::Growth, &[0.0, 0.3]) < -0.3);
        assert!(with(50.0, Vertical::Growth, &[0.0, 0.3]) > 0.2);
        assert!(with(800.0, Vertical::Scale, &[0.2]) < -0.19);
        assert!(
            with(800.0, Vertical::Deposition, &[0.01]) < with(100.0, Vertical::Deposition, &[0.01])
        );
        assert!((with(800.0, Vertical::Decay, &[1e-3]) + 0.16).abs() < 1e-9);
        assert!(with(800.0, Vertical::PlumeWind, &[]) < 0.0);
    }

    #[test]
    fn between_classes_lies_between() {
        let at = |p: f64| between_classes_m(300.0, p);
        let briggs = |c| sigma::sigma_z_m(300.0, c, Setting::Rural);
        assert!((at(3.0) - briggs(Stability::D)).abs() < 1e-9);
        assert!((at(5.0) - briggs(Stability::F)).abs() < 1e-9);
        assert!(at(3.4) < at(3.0) && at(3.4) > at(4.0));
    }

    #[test]
    fn width_from_azimuth() {
        let got = log_width(&weather(), 200.0, &[Lateral::Azimuth], &[]).map(f64::exp);
        assert!((got.unwrap() - 0.2 * 200.0 * pasquill_f(200.0)).abs() < 1e-9);
        let none = Weather {
            sigma_azimuth_rad: None,
            ..weather()
        };
        assert_eq!(log_width(&none, 200.0, &[Lateral::Azimuth], &[]), None);
        // Pasquill's own table: .8 at 100 m, .7 at 200 m, .65 at 400 m, .6 at 1 km.
        for (x, f) in [(100.0, 0.8), (200.0, 0.7), (400.0, 0.65), (1000.0, 0.6)] {
            assert!((pasquill_f(x) / f - 1.0).abs() < 0.08, "{x}");
        }
    }
}
