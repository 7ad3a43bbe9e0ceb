//! Spread of a plume with distance: Briggs (1973), rural and urban.

use crate::stability::Stability;

/// What the ground around the source is like.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Setting {
    /// Open country.
    Rural,
    /// Built-up.
    Urban,
}

/// One of Briggs' curves: a x (1 + b x)^p with p one of -1, -1/2, 0, +1/2.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Curve {
    pub(crate) a: f64,
    pub(crate) b: f64,
    pub(crate) power: Power,
}

#[derive(Debug, Clone, Copy)]
pub(crate) enum Power {
    MinusOne,
    MinusHalf,
    Half,
}

const fn curve(a: f64, b: f64, power: Power) -> Curve {
    Curve { a, b, power }
}

use Power::{Half, MinusHalf, MinusOne};

const RURAL_Y: [Curve; 6] = [
    curve(0.22, 1e-4, MinusHalf),
    curve(0.16, 1e-4, MinusHalf),
    curve(0.11, 1e-4, MinusHalf),
    curve(0.08, 1e-4, MinusHalf),
    curve(0.06, 1e-4, MinusHalf),
    curve(0.04, 1e-4, MinusHalf),
];
const RURAL_Z: [Curve; 6] = [
    curve(0.20, 0.0, Half),
    curve(0.12, 0.0, Half),
    curve(0.08, 2e-4, MinusHalf),
    curve(0.06, 1.5e-3, MinusHalf),
    curve(0.03, 3e-4, MinusOne),
    curve(0.016, 3e-4, MinusOne),
];
const URBAN_Y: [Curve; 6] = [
    curve(0.32, 4e-4, MinusHalf),
    curve(0.32, 4e-4, MinusHalf),
    curve(0.22, 4e-4, MinusHalf),
    curve(0.16, 4e-4, MinusHalf),
    curve(0.11, 4e-4, MinusHalf),
    curve(0.11, 4e-4, MinusHalf),
];
const URBAN_Z: [Curve; 6] = [
    curve(0.24, 1e-3, Half),
    curve(0.24, 1e-3, Half),
    curve(0.20, 0.0, Half),
    curve(0.14, 3e-4, MinusHalf),
    curve(0.08, 1.5e-3, MinusHalf),
    curve(0.08, 1.5e-3, MinusHalf),
];

impl Curve {
    #[inline]
    fn at(self, x_m: f64) -> f64 {
        let bracket = 1.0 + self.b * x_m;
        let shape = match self.power {
            MinusOne => 1.0 / bracket,
            MinusHalf => 1.0 / bracket.sqrt(),
            Half => bracket.sqrt(),
        };
        self.a * x_m * shape
    }
}

/// Lateral spread σy in m at `x_m` downwind (Briggs 1973; open country 100 m to 10 km).
#[inline]
pub fn sigma_y_m(x_m: f64, class: Stability, setting: Setting) -> f64 {
    curves(setting).0[class.index()].at(x_m)
}

/// Vertical spread σz in m at `x_m` downwind (Briggs 1973; open country 100 m to 10 km).
#[inline]
pub fn sigma_z_m(x_m: f64, class: Stability, setting: Setting) -> f64 {
    curves(setting).1[class.index()].at(x_m)
}

fn curves(setting: Setting) -> (&'static [Curve; 6], &'static [Curve; 6]) {
    match setting {
        Setting::Rural => (&RURAL_Y, &RURAL_Z),
        Setting::Urban => (&URBAN_Y, &URBAN_Z),
    }
}

/// Two curves of neighbouring classes and the part of the second: classes as a continuum.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spread {
    y: [Curve; 2],
    z: [Curve; 2],
    part: f64,
}

impl Spread {
    /// The spread at position `class + shift` between A (0) and F (5), geometric between classes:
    /// from one class to the next the curves differ by about a constant factor, and a fit needs a
    /// derivative by the class.
    pub(crate) fn new(class: Stability, shift: f64, setting: Setting) -> Self {
        let position = (class.index() as f64 + shift).clamp(0.0, 5.0);
        let low = (position.floor() as usize).min(4);
        let (y, z) = curves(setting);
        let part = position - low as f64;
        // On a class exactly, that class stands first and no power is needed.
        let (first, part) = if part == 1.0 {
            (low + 1, 0.0)
        } else {
            (low, part)
        };
        let second = (first + 1).min(5);
        Self {
            y: [y[first], y[second]],
            z: [z[first], z[second]],
            part,
        }
    }

    /// The curves of σy and σz where the spread is that of one class, not between two.
    pub(crate) fn of_one_class(&self) -> Option<(Curve, Curve)> {
        (self.part == 0.0).then_some((self.y[0], self.z[0]))
    }

    /// (σy, σz) in m at `x_m` downwind.
    #[inline]
    pub(crate) fn at(&self, x_m: f64) -> (f64, f64) {
        let (y, z) = (self.y[0].at(x_m), self.z[0].at(x_m));
        if self.part == 0.0 {
            return (y, z);
        }
        (
            y * (self.y[1].at(x_m) / y).powf(self.part),
            z * (self.z[1].at(x_m) / z).powf(self.part),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // Briggs (1973) by hand at 1 km and 5 km: e.g. D rural at 1 km: 80/sqrt(1.1) = 76.277,
    // 60/sqrt(2.5) = 37.947; F rural at 5 km: 200/sqrt(1.5) = 163.299, 80/2.5 = 32.
    #[test]
    fn briggs_by_hand() {
        use Setting::{Rural, Urban};
        use Stability::{A, B, C, D, E, F};
        for (class, setting, x, y, z) in [
            (A, Rural, 1000.0, 209.762, 200.0),
            (B, Rural, 1000.0, 152.554, 120.0),
            (C, Rural, 1000.0, 104.881, 73.030),
            (D, Rural, 1000.0, 76.277, 37.947),
            (E, Rural, 1000.0, 57.208, 23.077),
            (F, Rural, 5000.0, 163.299, 32.0),
            (A, Urban, 1000.0, 270.449, 339.411),
            (B, Urban, 1000.0, 270.449, 339.411),
            (C, Urban, 1000.0, 185.934, 200.0),
            (D, Urban, 1000.0, 135.225, 122.788),
            (E, Urban, 1000.0, 92.967, 50.596),
            (F, Urban, 1000.0, 92.967, 50.596),
        ] {
            assert!(
                (sigma_y_m(x, class, setting) / y - 1.0).abs() < 1e-5,
                "{class:?} y"
            );
            assert!(
                (sigma_z_m(x, class, setting) / z - 1.0).abs() < 1e-5,
                "{class:?} z"
            );
        }
    }

    #[test]
    fn a_shift_of_one_class_is_the_next_class() {
        for class in &Stability::ALL[..5] {
            let next = Stability::ALL[class.index() + 1];
            let (y, z) = Spread::new(*class, 1.0, Setting::Rural).at(2400.0);
            assert_eq!(y, sigma_y_m(2400.0, next, Setting::Rural));
            assert_eq!(z, sigma_z_m(2400.0, next, Setting::Rural));
        }
    }

    proptest::proptest! {
        #[test]
        fn grows_with_distance_and_shrinks_with_stability(
            x in 10.0f64..20_000.0, shift in -4.0f64..3.9, by in 0.01f64..0.5) {
            let at = |s: f64, x: f64| Spread::new(Stability::D, s, Setting::Rural).at(x);
            let (y, z) = at(shift, x);
            let (y_far, z_far) = at(shift, x * 1.1);
            proptest::prop_assert!(y_far > y && z_far > z);
            let (y_stable, z_stable) = at(shift + by, x);
            proptest::prop_assert!(y_stable <= y && z_stable <= z);
        }
    }
}
