//! The numbers the equations of motion are written in: one `f64`, or several side by side.
//!
//! The physics of this crate is written once over [`Real`]. With `f64` it flies one vehicle; with
//! [`Lanes`] it flies [`LANES`] vehicles at once in vector registers. Both do the same operations
//! in the same order, so that a vehicle flies the same alone and in a fleet.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// How many vehicles one [`Lanes`] holds: the doubles of an AVX-512 register.
pub const LANES: usize = 8;

/// A real number, or several side by side.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
{
    /// The same number everywhere.
    fn splat(value: f64) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// The smaller of two.
    fn min(self, other: Self) -> Self;
    /// The larger of two.
    fn max(self, other: Self) -> Self;
    /// `yes` where `self > than`, else `no`.
    fn where_gt(self, than: Self, yes: Self, no: Self) -> Self;

    /// Kept inside `[low, high]`.
    #[inline(always)]
    fn clamp_to(self, low: f64, high: f64) -> Self {
        self.max(Self::splat(low)).min(Self::splat(high))
    }

    /// The angle of the point (x = `x`, y = `self`), rad in `[−π, π]`; 0 at the origin.
    ///
    /// Branch-free so that it vectorises: reduced to |t| ≤ tan(π/8), then the rational
    /// approximation of the Cephes library (S. Moshier, 1989); error below 2 ulp.
    #[inline(always)]
    fn angle_to(self, x: Self) -> Self {
        let zero = Self::splat(0.0);
        let (ax, ay) = (x.abs(), self.abs());
        let (low, high) = (ax.min(ay), ax.max(ay));
        let threshold = high * (std::f64::consts::SQRT_2 - 1.0);
        let top = low.where_gt(threshold, low - high, low);
        let bottom = low.where_gt(threshold, low + high, high);
        let offset = low.where_gt(threshold, Self::splat(FRAC_PI_4), zero);
        let t = top / bottom.max(Self::splat(f64::MIN_POSITIVE));
        let angle = offset + small_arctangent(t);
        let angle = ay.where_gt(ax, -(angle - FRAC_PI_2), angle);
        let angle = zero.where_gt(x, -(angle - PI), angle);
        zero.where_gt(self, -angle, angle)
    }
}

/// Arctangent for |t| ≤ 0.66: t + t z P(z)/Q(z) with z = t².
#[inline(always)]
fn small_arctangent<R: Real>(t: R) -> R {
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

impl Real for f64 {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn where_gt(self, than: Self, yes: Self, no: Self) -> Self {
        if self > than { yes } else { no }
    }
}

/// [`LANES`] numbers side by side.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(64))]
pub struct Lanes(pub [f64; LANES]);

/// Applies `f` lane by lane to two operands.
#[inline(always)]
fn zip(a: Lanes, b: Lanes, f: impl Fn(f64, f64) -> f64) -> Lanes {
    let mut out = [0.0; LANES];
    for (lane, out) in out.iter_mut().enumerate() {
        *out = f(a.0[lane], b.0[lane]);
    }
    Lanes(out)
}

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                zip(self, other, |a, b| a $op b)
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

macro_rules! lanewise_with_one {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait<f64> for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                zip(self, Lanes([other; LANES]), |a, b| a $op b)
            }
        }
    };
}
lanewise_with_one!(Add, add, +);
lanewise_with_one!(Sub, sub, -);
lanewise_with_one!(Mul, mul, *);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        zip(self, self, |a, _| -a)
    }
}

impl Real for Lanes {
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Lanes([value; LANES])
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        zip(self, self, |a, _| a.sqrt())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        zip(self, self, |a, _| a.abs())
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        zip(self, other, Real::min)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        zip(self, other, Real::max)
    }
    #[inline(always)]
    fn where_gt(self, than: Self, yes: Self, no: Self) -> Self {
        let mut out = [0.0; LANES];
        for (lane, out) in out.iter_mut().enumerate() {
            *out = if self.0[lane] > than.0[lane] {
                yes.0[lane]
            } else {
                no.0[lane]
            };
        }
        Lanes(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn angle_is_the_library_arctangent(y in -50.0..50.0_f64, x in -50.0..50.0_f64) {
            let angle = y.angle_to(x);
            prop_assert!((angle - y.atan2(x)).abs() <= 1e-15 * angle.abs().max(1.0));
            let lanes = Lanes::splat(y).angle_to(Lanes::splat(x));
            prop_assert!(lanes.0.iter().all(|lane| lane.to_bits() == angle.to_bits()));
        }
    }

    #[test]
    fn angle_of_the_axes() {
        assert_eq!(0.0.angle_to(0.0), 0.0);
        assert_eq!(0.0.angle_to(1.0), 0.0);
        assert_eq!(1.0.angle_to(0.0), FRAC_PI_2);
        assert_eq!((-1.0).angle_to(0.0), -FRAC_PI_2);
        assert_eq!(0.0.angle_to(-1.0), PI);
    }
}
