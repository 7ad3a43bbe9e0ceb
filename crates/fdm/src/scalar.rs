//! Arithmetic without branches, so that loops over many vehicles become vector instructions.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, SQRT_2};

/// `value` kept inside `[low, high]`; `low` for what is not a number.
#[inline(always)]
pub(crate) fn bounded(value: f64, low: f64, high: f64) -> f64 {
    let value = if value > low { value } else { low };
    if value < high { value } else { high }
}

/// The larger of two, the second where either is not a number.
#[inline(always)]
pub(crate) fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The angle of the point (`x`, `y`), rad in `[−π, π]`; 0 at the origin.
///
/// Branch-free so that it vectorises: reduced to |t| ≤ tan(π/8), then the rational approximation
/// of the Cephes library (S. Moshier, 1989).
#[inline(always)]
pub(crate) fn angle(y: f64, x: f64) -> f64 {
    let (ax, ay) = (x.abs(), y.abs());
    let steep = ay > ax;
    let (low, high) = if steep { (ax, ay) } else { (ay, ax) };
    let outer = low > high * (SQRT_2 - 1.0);
    let top = if outer { low - high } else { low };
    let bottom = if outer { low + high } else { high };
    let offset = if outer { FRAC_PI_4 } else { 0.0 };
    let angle = offset + small_arctangent(top / larger(bottom, f64::MIN_POSITIVE));
    let angle = if steep { FRAC_PI_2 - angle } else { angle };
    let angle = if x < 0.0 { PI - angle } else { angle };
    if y < 0.0 { -angle } else { angle }
}

/// Arctangent for |t| ≤ 0.66: t + t z P(z)/Q(z) with z = t².
#[inline(always)]
fn small_arctangent(t: f64) -> f64 {
    let z = t * t;
    let p = z * -8.750_608_600_031_904e-1 - 1.615_753_718_733_365e1;
    let p = p * z - 7.500_855_792_314_705e1;
    let p = p * z - 1.228_866_684_490_136_2e2;
    let p = p * z - 6.485_021_904_942_025e1;
    let q = z + 2.485_846_490_142_306e1;
    let q = q * z + 1.650_270_098_316_988_5e2;
    let q = q * z + 4.328_810_604_912_902_7e2;
    let q = q * z + 4.853_903_996_359_137e2;
    let q = q * z + 1.945_506_571_482_614e2;
    t + t * z * (p / q)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn angle_is_the_library_arctangent(y in -50.0..50.0_f64, x in -50.0..50.0_f64) {
            let ours = angle(y, x);
            prop_assert!((ours - y.atan2(x)).abs() <= 1e-15 * ours.abs().max(1.0));
        }
    }

    #[test]
    fn angle_of_the_axes() {
        assert_eq!(angle(0.0, 0.0), 0.0);
        assert_eq!(angle(0.0, 1.0), 0.0);
        assert_eq!(angle(1.0, 0.0), FRAC_PI_2);
        assert_eq!(angle(-1.0, 0.0), -FRAC_PI_2);
        assert_eq!(angle(0.0, -1.0), PI);
    }
}
