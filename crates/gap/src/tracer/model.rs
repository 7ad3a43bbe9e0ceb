//! Briggs' open-country plume with changes: crosswind-integrated concentration, width and vertical spread.

use plume::sigma::{self, Setting};
use plume::stability::Stability;
use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, PI};

use super::arcs::Weather;
use crate::verdict::Parameter;

/// Distance at which a change of growth changes nothing, m: the geometric middle of the arcs of
/// most field trials. The catalogue's pivot of 1 km is applied when a finding is written down.
pub const PIVOT_M: f64 = 200.0;

/// An input: the wind at 0.6 of the plume's mean height instead of that at the anemometer.
pub const PLUME_WIND: &str = "wind-at-plume-height";
/// An input: σ_z between the classes' curves by 1/L, instead of the class's own.
pub const CONTINUUM: &str = "spread-by-obukhov-length";
/// An input: σ_y = σ_azimuth x f(x) instead of Briggs'.
pub const AZIMUTH: &str = "sigma-y-from-azimuth";
/// Changes of a number: σ_z by a factor, or by a factor and a power of distance, ...
pub const Z_SCALE: &str = "sigma-z-scale";
pub const Z_GROWTH: &str = "sigma-z-growth";
/// ... a loss at the ground, a loss everywhere at a constant rate, the release by a factor, ...
pub const DEPOSITION: &str = "dry-deposition";
pub const DECAY: &str = "first-order-decay";
pub const EMISSION: &str = "emission-scale";
/// ... and σ_y as σ_z.
pub const Y_SCALE: &str = "sigma-y-scale";
pub const Y_GROWTH: &str = "sigma-y-growth";

/// Releases are metered: one experiment in three hundred is taken to have a wrong one.
const WRONG_RELEASE: f64 = 0.003;

/// Numbers that changes have, each in a coordinate in which 0 changes nothing and its prior is normal about it, or the
/// positive half of that; factors are fitted as logarithms.
pub type Numbers = [f64; 8];

const Z_EXPONENT: usize = 0;
const LN_Z: usize = 1;
const VELOCITY: usize = 2;
const RATE: usize = 3;
const LN_RELEASE: usize = 4;
const Y_EXPONENT: usize = 5;
const LN_Y: usize = 6;
/// A factor on the arcs at one distance, which has no name.
const LN_OFFSET: usize = 7;

/// Mechanism, name and unit of each number.
pub const WORDS: [[&str; 3]; 8] = [
    [Z_GROWTH, "exponent", "1"],
    [Z_SCALE, "factor", "1"],
    [DEPOSITION, "velocity_m_s", "m/s"],
    [DECAY, "rate_per_s", "1/s"],
    [EMISSION, "factor", "1"],
    [Y_GROWTH, "exponent", "1"],
    [Y_SCALE, "factor", "1"],
    ["", "", ""],
];

/// Standard deviations of their priors. Spread is known to a third or so (Pasquill & Smith 1983). Deposition velocities
/// of SO2 and gases like it on grass are about 1 cm/s (Sehmel 1980), the mean of their half-normal prior. SO2 is oxidised
/// in the gas phase at 0.5 to 5 % an hour, in fog up to ten times faster (Seinfeld & Pandis 2006, chapter 7), so a decay
/// that would show within a kilometre is chemically absurd.
pub const PRIOR_SD: Numbers = [0.3, 0.35, 0.0125, 3e-5, 0.35, 0.3, 0.35, 0.5];

/// Whether a number is positive.
pub fn is_positive(number: usize) -> bool {
    [VELOCITY, RATE].contains(&number)
}

/// The factor that a change of growth has in it.
pub fn factor_in(id: &str) -> Option<&'static str> {
    match id {
        Z_GROWTH => Some(Z_SCALE),
        Y_GROWTH => Some(Y_SCALE),
        _ => None,
    }
}

/// Numbers in the catalogue's words: factors, those of spread at 1 km.
pub fn written(numbers: &Numbers) -> Numbers {
    let mut out = *numbers;
    for (ln, exponent) in [(LN_Z, Z_EXPONENT), (LN_Y, Y_EXPONENT)] {
        out[ln] = (numbers[ln] + numbers[exponent] * (1000.0 / PIVOT_M).ln()).exp();
    }
    out[LN_RELEASE] = numbers[LN_RELEASE].exp();
    out
}

/// Whether arcs of different trials count as at one distance.
pub fn same_distance(a_m: f64, b_m: f64) -> bool {
    (a_m / b_m).ln().abs() < 0.1
}

/// What is measured at a distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Quantity {
    /// Crosswind-integrated concentration at a height above ground, mg/m².
    Integral { height_m: f64 },
    /// Width of the plume, m.
    Width,
    /// Vertical spread at towers, m.
    TowerSpread,
}

/// A measured logarithm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Datum {
    pub quantity: Quantity,
    pub ln: f64,
    pub x_m: f64,
    /// Logarithm of the distance over the pivot.
    pub ln_x: f64,
}

impl Datum {
    pub fn new(quantity: Quantity, value: f64, x_m: f64) -> Self {
        Self {
            quantity,
            ln: value.ln(),
            x_m,
            ln_x: (x_m / PIVOT_M).ln(),
        }
    }
}

/// Briggs' plume with changes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Model {
    /// Ids of the changes; none for Briggs' plume and the wind as measured.
    pub ids: Vec<&'static str>,
    /// Their numbers.
    pub free: Vec<usize>,
    /// Distance, m, of the arcs that have a factor of their own: a misfit without a name.
    offset_at_m: Option<f64>,
}

impl Model {
    pub fn new(ids: Vec<&'static str>) -> Self {
        let has = |mechanism: &str| {
            let of = |id: &&str| *id == mechanism || factor_in(id) == Some(mechanism);
            ids.iter().any(of)
        };
        let free = (0..WORDS.len()).filter(|k| has(WORDS[*k][0]));
        Self {
            free: free.collect(),
            offset_at_m: None,
            ids,
        }
    }

    /// A model and its numbers as a finding has them; none where a change is not known, or a number is missing or has
    /// no logarithm.
    pub fn of_finding(ids: &[String], parameters: &[Parameter]) -> Option<(Self, Numbers)> {
        let mut known = Self::vertical().into_iter().chain(Self::lateral(true));
        let model = known.find(|m| m.ids == ids)?;
        let mut numbers = written(&Numbers::default());
        for &k in &model.free {
            let own = parameters.iter().find(|p| p.mechanism == WORDS[k][0]);
            numbers[k] = own?.value;
        }
        for (ln, exponent) in [(LN_Z, Z_EXPONENT), (LN_Y, Y_EXPONENT)] {
            numbers[ln] = numbers[ln].ln() - numbers[exponent] * (1000.0 / PIVOT_M).ln();
        }
        numbers[LN_RELEASE] = numbers[LN_RELEASE].ln();
        let is_finite = numbers.iter().all(|n| n.is_finite());
        is_finite.then_some((model, numbers))
    }

    /// The same with a factor of its own on all arcs at one distance.
    pub fn with_offset_at(&self, distance_m: f64) -> Self {
        let mut model = self.clone();
        model.free.push(LN_OFFSET);
        model.offset_at_m = Some(distance_m);
        model
    }

    /// The factor on the arcs at the distance of an offset.
    pub fn offset(numbers: &Numbers) -> f64 {
        numbers[LN_OFFSET].exp()
    }

    /// The models of integrals and towers: each change alone and deposition with a change of spread, with the wind at
    /// either height, and with spread by class or between classes.
    pub fn vertical() -> Vec<Self> {
        let sets: [&[&str]; 8] = [
            &[],
            &[Z_SCALE],
            &[Z_GROWTH],
            &[DEPOSITION],
            &[DECAY],
            &[EMISSION],
            &[Z_SCALE, DEPOSITION],
            &[Z_GROWTH, DEPOSITION],
        ];
        let inputs: [&[&str]; 4] = [&[], &[PLUME_WIND], &[CONTINUUM], &[PLUME_WIND, CONTINUUM]];
        let with_inputs = |set| inputs.map(|input| Self::new([input, set].concat()));
        sets.into_iter().flat_map(with_inputs).collect()
    }

    /// The models of widths: Briggs' or, where it is measured, the azimuth's width, as it is, scaled, or growing
    /// otherwise.
    pub fn lateral(with_azimuth: bool) -> Vec<Self> {
        let sets: [&[&str]; 3] = [&[], &[Y_SCALE], &[Y_GROWTH]];
        let inputs: [&[&str]; 2] = [&[], &[AZIMUTH]];
        let inputs = &inputs[..1 + usize::from(with_azimuth)];
        let with_sets = |input| sets.map(|set| Self::new([input, set].concat()));
        inputs.iter().copied().flat_map(with_sets).collect()
    }

    fn has(&self, id: &str) -> bool {
        self.ids.contains(&id)
    }

    /// Logarithm of its probability beforehand, against the others'.
    pub fn ln_prior(&self) -> f64 {
        if self.has(EMISSION) {
            WRONG_RELEASE.ln()
        } else {
            0.0
        }
    }

    /// The logarithm of a datum in this weather; not a number where the weather lacks what it needs.
    pub fn predict(&self, weather: &Weather, datum: &Datum, numbers: &Numbers) -> f64 {
        match datum.quantity {
            Quantity::Integral { height_m } => {
                let offset = match self.offset_at_m {
                    Some(at_m) if same_distance(datum.x_m, at_m) => numbers[LN_OFFSET],
                    _ => 0.0,
                };
                offset + self.ln_integral(weather, datum.x_m, height_m, numbers)
            }
            Quantity::Width => self
                .ln_width(weather, datum.x_m, numbers)
                .unwrap_or(f64::NAN),
            Quantity::TowerSpread => self.sigma_z_m(weather, datum.x_m, numbers).ln(),
        }
    }

    fn sigma_z_m(&self, weather: &Weather, x_m: f64, numbers: &Numbers) -> f64 {
        let briggs = if self.has(CONTINUUM) {
            between_classes_m(x_m, weather.class_position)
        } else {
            sigma::sigma_z_m(x_m, weather.class, Setting::Rural)
        };
        let changed = briggs * (numbers[LN_Z] + numbers[Z_EXPONENT] * (x_m / PIVOT_M).ln()).exp();
        // A plume mixed through the layer grows no more.
        changed.min(weather.mixing_height_m.map_or(f64::INFINITY, |zi| 0.8 * zi))
    }

    /// Transport speed of a plume with `sigma_z_m`, m/s: that at 0.6 of its mean height
    /// √(2/π) σ_z (van Ulden 1978).
    fn speed_m_s(&self, weather: &Weather, sigma_z_m: f64) -> f64 {
        if self.has(PLUME_WIND) {
            let mean_height = FRAC_2_PI.sqrt() * sigma_z_m;
            wind_speed_m_s(weather, 0.6 * mean_height.max(weather.source_height_m))
        } else {
            weather.wind_speed_m_s
        }
    }

    /// ln of the part still airborne at `x_m`: source depletion with full reflection, and decay.
    fn ln_airborne(&self, weather: &Weather, x_m: f64, numbers: &Numbers) -> f64 {
        const STEPS: usize = 16;
        let decayed = numbers[RATE] * x_m / weather.wind_speed_m_s;
        if numbers[VELOCITY] == 0.0 {
            return -decayed;
        }
        let ratio = x_m.powf(1.0 / STEPS as f64);
        let step = |k: usize| {
            let x = ratio.powf(k as f64 + 0.5);
            let sigma = self.sigma_z_m(weather, x, numbers);
            let bell = (-0.5 * (weather.source_height_m / sigma).powi(2)).exp();
            FRAC_2_PI.sqrt() * bell / (sigma * self.speed_m_s(weather, sigma)) * x * ratio.ln()
        };
        -decayed - numbers[VELOCITY] * (0..STEPS).map(step).sum::<f64>()
    }

    /// ln of the crosswind-integrated concentration in mg/m², with the ground reflecting.
    pub fn ln_integral(&self, weather: &Weather, x_m: f64, z_m: f64, numbers: &Numbers) -> f64 {
        let sigma = self.sigma_z_m(weather, x_m, numbers);
        let speed = self.speed_m_s(weather, sigma);
        let bell = |z: f64| (-0.5 * (z / sigma).powi(2)).exp();
        let h = weather.source_height_m;
        let vertical = (bell(z_m - h) + bell(z_m + h)).max(1e-300);
        (weather.release_mg_s * vertical / ((2.0 * PI).sqrt() * speed * sigma)).ln()
            + numbers[LN_RELEASE]
            + self.ln_airborne(weather, x_m, numbers)
    }

    /// ln of the width in m; none where the deviation of azimuth is called for and not known.
    pub fn ln_width(&self, weather: &Weather, x_m: f64, numbers: &Numbers) -> Option<f64> {
        let sigma = if self.has(AZIMUTH) {
            weather.sigma_azimuth_rad? * x_m * pasquill_f(x_m)
        } else {
            sigma::sigma_y_m(x_m, weather.class, Setting::Rural)
        };
        Some(sigma.ln() + numbers[LN_Y] + numbers[Y_EXPONENT] * (x_m / PIVOT_M).ln())
    }
}

/// ln of the peak of a normal distribution across, from the logarithms of its integral and width.
pub fn ln_peak(ln_integral: f64, ln_width: f64) -> f64 {
    ln_integral - ln_width - 0.5 * (2.0 * PI).ln()
}

/// Briggs' σ_z in m between the curves of two classes, even in the logarithm.
fn between_classes_m(x_m: f64, position: f64) -> f64 {
    let below = (position.floor() as usize).min(Stability::ALL.len() - 2);
    let share = position - below as f64;
    let ln = |class: usize| sigma::sigma_z_m(x_m, Stability::ALL[class], Setting::Rural).ln();
    ((1.0 - share) * ln(below) + share * ln(below + 1)).exp()
}

/// Pasquill's (1976) universal f(x) in σ_y = σ_azimuth x f(x), in the form 1/(1 + .0308 x^.4548)
/// that Irwin (1979) gave it; x in m, up to 10 km.
fn pasquill_f(x_m: f64) -> f64 {
    1.0 / (1.0 + 0.0308 * x_m.powf(0.4548))
}

/// The integrated stability function ψ_m of height over Obukhov length: log-linear in stable air (Webb 1970 beyond
/// z = L), Businger–Dyer in unstable air (Dyer 1974; Paulson 1970).
fn psi(zeta: f64) -> f64 {
    if zeta < 0.0 {
        let x = (1.0 - 16.0 * zeta).powf(0.25);
        2.0 * ((1.0 + x) / 2.0).ln() + ((1.0 + x * x) / 2.0).ln() - 2.0 * x.atan() + FRAC_PI_2
    } else if zeta < 1.0 {
        -5.0 * zeta
    } else {
        -5.0 * (1.0 + zeta.ln())
    }
}

/// Wind speed at `height_m` above ground, m/s: the profile's shape through the measured wind.
/// Heights below ten roughness lengths take the wind of that height.
fn wind_speed_m_s(weather: &Weather, height_m: f64) -> f64 {
    let (z0, length) = (weather.roughness_m, weather.obukhov_length_m);
    let shape = |z: f64| {
        let z = z.max(10.0 * z0);
        (z / z0).ln() - psi(z / length) + psi(z0 / length)
    };
    weather.wind_speed_m_s * shape(height_m) / shape(weather.wind_height_m)
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

    fn integral(x_m: f64, ids: &[&'static str], numbers: &[(usize, f64)]) -> f64 {
        let mut all = Numbers::default();
        numbers.iter().for_each(|(k, value)| all[*k] = *value);
        Model::new(ids.to_vec()).ln_integral(&weather(), x_m, 1.5, &all)
    }

    // By hand: class C at 100 m, σz = 8/√1.02 = 7.92118; (2·1e5)/(√2π·5·7.92118) = 2014.6, times
    // the mean of the two bells at 1.04 and 1.96 m (.99142 and .96984) gives 1975.6 mg/m².
    #[test]
    fn integrated_by_hand() {
        let got = integral(100.0, &[], &[]).exp();
        assert!((got / 1975.6 - 1.0).abs() < 1e-3, "{got}");
    }

    #[test]
    fn changes_have_the_right_sense() {
        let with = |x, id, numbers: &[_]| integral(x, &[id], numbers) - integral(x, &[], &[]);
        assert!(with(800.0, Z_GROWTH, &[(Z_EXPONENT, 0.3)]) < -0.3);
        assert!(with(50.0, Z_GROWTH, &[(Z_EXPONENT, 0.3)]) > 0.2);
        assert!(with(800.0, Z_SCALE, &[(LN_Z, 0.2)]) < -0.19);
        let lost = |x| with(x, DEPOSITION, &[(VELOCITY, 0.01)]);
        assert!(lost(800.0) < lost(100.0));
        assert!((with(800.0, DECAY, &[(RATE, 1e-3)]) + 0.16).abs() < 1e-9);
        assert!(with(800.0, PLUME_WIND, &[]) < 0.0);
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
        let model = Model::new(vec![AZIMUTH]);
        let width = |w: &Weather| model.ln_width(w, 200.0, &Numbers::default()).map(f64::exp);
        assert!((width(&weather()).unwrap() - 0.2 * 200.0 * pasquill_f(200.0)).abs() < 1e-9);
        let none = Weather {
            sigma_azimuth_rad: None,
            ..weather()
        };
        assert_eq!(width(&none), None);
        // Pasquill's own table: .8 at 100 m, .7 at 200 m, .65 at 400 m, .6 at 1 km.
        for (x, f) in [(100.0, 0.8), (200.0, 0.7), (400.0, 0.65), (1000.0, 0.6)] {
            assert!((pasquill_f(x) / f - 1.0).abs() < 0.08, "{x}");
        }
    }

    #[test]
    fn fitted_numbers_come_back() {
        for ids in [
            &[PLUME_WIND, Z_GROWTH, DEPOSITION][..],
            &[AZIMUTH, Y_SCALE],
            &[DECAY],
            &[EMISSION],
        ] {
            let model = Model::new(ids.to_vec());
            let mut fitted = Numbers::default();
            for (k, value) in model.free.iter().zip([0.2, -0.3, 0.004]) {
                fitted[*k] = value;
            }
            let parameter = |k: &usize| Parameter {
                mechanism: WORDS[*k][0].into(),
                name: WORDS[*k][1].into(),
                value: written(&fitted)[*k],
                sd: 0.1,
                unit: WORDS[*k][2].into(),
            };
            let parameters: Vec<Parameter> = model.free.iter().map(parameter).collect();
            let ids: Vec<String> = ids.iter().map(|id| (*id).to_owned()).collect();
            let (back, numbers) = Model::of_finding(&ids, &parameters).unwrap();
            assert_eq!(back, model);
            for (a, b) in numbers.iter().zip(fitted) {
                assert!((a - b).abs() < 1e-12, "{ids:?}: {numbers:?}");
            }
            assert_eq!(Model::of_finding(&ids, &[]), None);
        }
    }

    fn speed_m_s(obukhov_length_m: f64, height_m: f64) -> f64 {
        let weather = Weather {
            obukhov_length_m,
            ..weather()
        };
        wind_speed_m_s(&weather, height_m)
    }

    // By hand: neutral u(10)/u(2) = ln(10/.006)/ln(2/.006) = 7.41858/5.80914.
    // ψ(-1), Paulson (1970): x = 17^(1/4), 2 ln 1.515272 + ln 2.561553 - 2 atan 2.030543 + π/2.
    #[test]
    fn profiles_by_hand() {
        let ratio = speed_m_s(1e9, 10.0) / 5.0;
        assert!((ratio - 7.418_58 / 5.809_14).abs() < 1e-4, "{ratio}");
        assert!((psi(-1.0) - 1.116_230).abs() < 1e-4, "{}", psi(-1.0));
        assert!((psi(1.0 + 1e-9) - psi(1.0 - 1e-9)).abs() < 1e-6);
    }

    #[test]
    fn stable_air_shears_more_than_unstable() {
        let at = |l: f64| speed_m_s(l, 20.0);
        assert!(at(20.0) > at(1e9) && at(1e9) > at(-20.0) && at(-20.0) > 5.0);
    }
}
