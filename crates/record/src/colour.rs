//! How readings are shown: their gas, its digits, and one scale of colours for the KML tracks, the report
//! and the page.

use plume::{Gas, Unit};
use scenario::Scenario;
use scenario::airspace::{Airspace, SETPOINT_MARGIN_M};
use scenario::peak::highest_of;
use scenario::world::WorldError;

/// Part of the greatest excess that may be flown into at which another gas than CO2 is red: as 840 ppm of
/// CO2 are in the reference mission.
const RED_PART: f64 = 0.2;
/// Contour lines, ppm above background, and the excess at which the shade of the plume is darkest; of CO2.
const LEVELS_OF_CO2_PPM: [f64; 3] = [20.0, 100.0, 400.0];
const DARKEST_OF_CO2_PPM: f64 = 700.0;

/// How mole fractions of a mission's gas are shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shown {
    /// The gas.
    pub gas: Gas,
    /// At and below this reading the colour is grey, ppm.
    pub grey_ppm: f64,
    /// At and above this reading the colour is red, ppm.
    pub red_ppm: f64,
}

impl Shown {
    /// CO2, on a scale that all its missions share.
    pub const CO2: Self = Self {
        gas: Gas::Co2,
        grey_ppm: 450.0,
        red_ppm: 840.0,
    };

    /// As a scenario's gas is shown: other gases than CO2 from their background on, as far as the scenario's
    /// plume goes.
    ///
    /// # Errors
    /// A scenario that describes no world.
    pub fn of(scenario: &Scenario) -> Result<Self, WorldError> {
        let gas = scenario.gas();
        if gas == Gas::Co2 {
            return Ok(Self::CO2);
        }
        let model = scenario.dispersion_model()?;
        let airspace = Airspace::of(scenario)?;
        let grey_ppm = model.spec().background_ppm;
        let highest = highest_of(&model, &airspace, SETPOINT_MARGIN_M, 0.0);
        let excess_ppm = highest.map_or(0.0, |h| RED_PART * (h.co2_ppm - grey_ppm));
        // A plume that noise hides makes no scale.
        let least_ppm = 10.0 * model.spec().sensor.noise_sd_ppm;
        Ok(Self {
            gas,
            grey_ppm,
            red_ppm: grey_ppm + rounded_up(excess_ppm.max(least_ppm)),
        })
    }

    /// The same with its head at the highest reading where that is above it, in steps of half a power of ten.
    pub fn reaching(self, highest_ppm: f64) -> Self {
        let excess_ppm = highest_ppm - self.grey_ppm;
        let step = 0.5 * 10f64.powf(excess_ppm.max(f64::MIN_POSITIVE).log10().floor());
        let red_ppm = self.grey_ppm + (excess_ppm / step).ceil() * step;
        if red_ppm > self.red_ppm {
            Self { red_ppm, ..self }
        } else {
            self
        }
    }

    /// Its unit with the gas, for axes and legends: "CH4, ppm".
    pub fn axis(&self) -> String {
        format!("{}, {}", self.gas.formula(), Unit::Ppm.as_str())
    }

    /// The number alone, with the digits that the gas needs.
    pub fn number(&self, ppm: f64) -> String {
        number(self.gas, ppm)
    }

    /// Steps that are shown in a ppm.
    pub fn steps_per_ppm(&self) -> f64 {
        10f64.powi(i32::try_from(self.gas.digits()).unwrap_or_default())
    }

    /// Contour lines of a plume, ppm above background.
    pub fn levels_ppm(&self) -> [f64; 3] {
        let of_co2 = Self::CO2.red_ppm - Self::CO2.grey_ppm;
        match self.gas {
            Gas::Co2 => LEVELS_OF_CO2_PPM,
            _ => LEVELS_OF_CO2_PPM.map(|l| rounded_up(l / of_co2 * (self.red_ppm - self.grey_ppm))),
        }
    }

    /// Excess at which the shade of the plume is darkest, ppm.
    pub fn darkest_ppm(&self) -> f64 {
        DARKEST_OF_CO2_PPM * self.levels_ppm()[2] / LEVELS_OF_CO2_PPM[2]
    }

    /// How far a reading is along the scale, 0 to 1. What is not finite is at its foot.
    pub fn along(&self, ppm: f64) -> f64 {
        let along = (ppm - self.grey_ppm) / (self.red_ppm - self.grey_ppm);
        if along.is_finite() {
            along.clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// The colour of a reading, as red, green, blue.
    pub(crate) fn colour(&self, ppm: f64) -> [u8; 3] {
        colour(self.along(ppm))
    }
}

/// A mole fraction of a gas in ppm with the digits that it needs, without its unit.
pub fn number(gas: Gas, ppm: f64) -> String {
    format!("{ppm:.*}", gas.digits())
}

/// The next 1, 2 or 5 of a power of ten, for people.
fn rounded_up(value: f64) -> f64 {
    let ten = 10f64.powf(value.max(f64::MIN_POSITIVE).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0];
    let step = steps.into_iter().find(|s| s * ten >= value * (1.0 - 1e-9));
    step.unwrap_or(10.0) * ten
}

/// Colours at equal steps of the scale: grey, ochre, orange, red. From ochre
/// on they darken, so that their order is seen without hue.
const STOPS: [[u8; 3]; 5] = [
    [158, 163, 170],
    [214, 178, 94],
    [238, 139, 48],
    [227, 79, 38],
    [190, 10, 38],
];

/// The colour `along` the scale, 0 to 1.
fn colour(along: f64) -> [u8; 3] {
    let scaled = along * (STOPS.len() - 1) as f64;
    let from = (scaled as usize).min(STOPS.len() - 2);
    let rest = scaled - from as f64;
    std::array::from_fn(|channel| {
        let (a, b) = (STOPS[from][channel], STOPS[from + 1][channel]);
        (f64::from(a) + rest * (f64::from(b) - f64::from(a))).round() as u8
    })
}

/// The scale as stops for plotting libraries: position from 0 to 1 and `#rrggbb`.
pub fn stops() -> Vec<(f64, String)> {
    STOPS
        .iter()
        .enumerate()
        .map(|(i, [r, g, b])| {
            let at = i as f64 / (STOPS.len() - 1) as f64;
            (at, format!("#{r:02x}{g:02x}{b:02x}"))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_and_beyond() {
        let of_reading = |ppm| Shown::CO2.colour(ppm);
        assert_eq!(of_reading(449.0), of_reading(450.0));
        assert_eq!(of_reading(2000.0), of_reading(840.0));
        assert_eq!(of_reading(f64::NAN), of_reading(450.0));
        let reaching = |ppm: f64| Shown::CO2.reaching(ppm).red_ppm;
        assert_eq!(
            [3000.0, 700.0, f64::NAN].map(reaching),
            [3450.0, 840.0, 840.0]
        );
        let [r, g, b] = of_reading(840.0);
        assert!(r > 3 * g && r > 3 * b, "the top of the scale is red");
        let [r, g, b] = of_reading(450.0);
        assert!(r.abs_diff(g) < 20 && g.abs_diff(b) < 20, "its foot is grey");
    }

    #[test]
    fn from_the_second_stop_more_is_darker() {
        // Rec. 709 luma; steps of 10 ppm are wider than the rounding to bytes.
        let luma = |ppm: f64| {
            let [r, g, b] = Shown::CO2.colour(ppm).map(f64::from);
            0.2126 * r + 0.7152 * g + 0.0722 * b
        };
        for step in 0..29 {
            let ppm = 550.0 + 10.0 * f64::from(step);
            assert!(luma(ppm) > luma(ppm + 10.0), "{ppm}");
        }
    }

    #[test]
    fn a_scale_begins_at_the_background_and_reaches_into_the_plume() {
        let text = "[site]\nlat_deg=43.4\nlon_deg=-7.8\nground_amsl_m=340\n[background]\nch4_ppb=1950\n\
            [[source]]\ngas=\"ch4\"\nlat_deg=43.4\nlon_deg=-7.8\nemission_kg_s=EMISSION\n\
            effective_height_m=200\n";
        let shown = |emission: &str| {
            let scenario = Scenario::parse("s.toml", &text.replace("EMISSION", emission)).unwrap();
            Shown::of(&scenario).unwrap()
        };
        let own = shown("0.5");
        assert_eq!(
            (own.gas, own.grey_ppm, own.axis()),
            (Gas::Ch4, 1.95, "CH4, ppm".to_owned())
        );
        assert_eq!(own.number(2.034), "2.034");
        // Of nothing the noise makes the scale: ten times 2 ppb.
        assert!((shown("0").red_ppm - 1.97).abs() < 1e-9);
        // A thousand times the gas makes a scale a thousand times as long.
        let (a, b) = (own.red_ppm - 1.95, shown("500").red_ppm - 1.95);
        assert!((b / a - 1000.0).abs() < 1e-6, "{a} {b}");
        assert!(own.levels_ppm().is_sorted() && own.levels_ppm()[2] >= a);
        assert!(
            Shown::CO2.levels_ppm() == [20.0, 100.0, 400.0] && Shown::CO2.darkest_ppm() == 700.0
        );
    }
}
