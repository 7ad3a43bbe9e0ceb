//! What crossings of the plume tell of it, so that the next one is flown where it tells most.
//!
//! A crossing at the distance x and the height z reads, in the mean over the eddies, the excess
//!
//! m = C (x/x_C)^−p exp(−(z − H)²/2σ_z²)
//!
//! of the unknowns ln C (C is c_MAX, at x_C), H, ln σ_z and p, by which the decay along the axis deviates from the
//! model's. Eddies displace the plume as a whole (Gifford 1959), by n of its spread σ_r in one crossing: with
//! ζ = (z − H)/σ_r a crossing reads in proportion to A = exp(−(ζ + n)²/2). For normal n of the covariance Σ
//!
//! E(A_i A_j) = |I + Σ|^−½ exp(−½ ζᵀ (I + Σ)⁻¹ ζ), and E(A_i) the same of one crossing,
//!
//! so that what two crossings deviate from their means has the relative covariance E(A_i A_j)/(E(A_i) E(A_j)) − 1.
//! Crossings that follow each other closely meet the same eddies: a displacement is the integral of the eddies' velocity
//! over the travel time T = x/u (Taylor 1921). For velocities that forget faster than that, two displacements correlate
//! by the time that their travel times share, over √(T_i T_j). Fluctuations inside the plume and the sensor's noise are
//! each crossing's own.
//!
//! The Fisher information of the crossings, F = P⁻¹ + Gᵀ N⁻¹ G with the priors' covariance P, the gradients G of ln m
//! and the noise N, gives the least variances that an unbiased estimate can have. They rank flights; what is published of
//! the plume comes from the correction of the model.

use nalgebra::{DMatrix, DVector, Matrix4, Vector4};

/// Part of the variance of the plume in ten minutes that is meander (Gifford 1959: half near a source).
const MEANDER_SHARE: f64 = 0.5;
/// Standard deviation of ln of what one crossing reads that is not displacement: fluctuations of an intensity of 0.3 to
/// 0.5 in a plume's core (Fackrell and Robins 1982), of which a crossing averages a few.
const FLUCTUATION: f64 = 0.2;
/// Standard deviation of p: σ_y σ_z grows between 1 and 3 km as x^1.6 in classes D and E, as x^1.8 in C and x^1.9 in B
/// (Briggs 1973).
const DECAY_SD: f64 = 0.2;

/// A crossing of the plume's axis, flown or planned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxisCrossing {
    /// When, s.
    pub time_s: f64,
    /// Distance from the source, m; above 0.
    pub distance_m: f64,
    /// Height above mean sea level, m.
    pub height_amsl_m: f64,
}

/// The plume as far as it is known.
#[derive(Clone, Copy)]
pub struct KnownPlume<'p> {
    /// Height of its axis above mean sea level, m.
    pub height_amsl_m: f64,
    /// Standard deviations before the flight: of ln C, of H, m, and of ln σ_z.
    pub prior_sd: (f64, f64, f64),
    /// Distance at which c_MAX is stated, m.
    pub c_max_distance_m: f64,
    /// Distance of the peak that may be flown to, m.
    pub peak_distance_m: f64,
    /// Wind speed, m/s.
    pub wind_m_s: f64,
    /// σ_z at a distance, m.
    pub sigma_z_m: &'p dyn Fn(f64) -> f64,
    /// Standard deviation of the sensor's noise over what the axis reads at a distance.
    pub noise: &'p dyn Fn(f64) -> f64,
}

/// What a mission asks of the plume, as standard deviations: of ln of the peak's excess, the flux and c_MAX, of H in m,
/// and of ln σ_z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Precision {
    /// Of the peak's excess, relative.
    pub peak: f64,
    /// Of the flux, relative, beside what the wind adds.
    pub flux: f64,
    /// Of c_MAX, relative.
    pub c_max: f64,
    /// Of the height of the axis, m.
    pub height_m: f64,
    /// Of σ_z, relative.
    pub sigma_z: f64,
}

impl Precision {
    fn all(&self) -> [f64; 5] {
        [
            self.peak,
            self.flux,
            self.c_max,
            self.height_m,
            self.sigma_z,
        ]
    }

    /// Nats by which `later` is better for what is asked. A number that is known as `asked` gains nothing more.
    pub fn gain(&self, later: &Self, asked: &Self) -> f64 {
        let numbers = self.all().into_iter().zip(later.all()).zip(asked.all());
        let each =
            numbers.map(|((before, after), asked)| (before.max(asked) / after.max(asked)).ln());
        each.sum()
    }

    /// Nothing is precise enough.
    pub const UNLIMITED: Self = Self {
        peak: f64::MIN_POSITIVE,
        flux: f64::MIN_POSITIVE,
        c_max: f64::MIN_POSITIVE,
        height_m: f64::MIN_POSITIVE,
        sigma_z: f64::MIN_POSITIVE,
    };
}

/// The information of some crossings.
#[derive(Clone)]
pub struct Information<'p> {
    plume: KnownPlume<'p>,
    crossings: Vec<AxisCrossing>,
    /// Factor L of the noise N = L Lᵀ.
    factor: DMatrix<f64>,
    /// L⁻¹ G, row by row.
    whitened: Vec<Vector4<f64>>,
    information: Matrix4<f64>,
}

impl<'p> Information<'p> {
    /// What the priors tell, before any crossing.
    pub fn prior(plume: KnownPlume<'p>) -> Self {
        let (strength, height_m, spread) = plume.prior_sd;
        let sd = Vector4::new(strength, height_m, spread, DECAY_SD);
        let weight = sd.map(|sd| sd.max(f64::MIN_POSITIVE.sqrt()).powi(-2));
        Self {
            plume,
            crossings: Vec::new(),
            factor: DMatrix::zeros(0, 0),
            whitened: Vec::new(),
            information: Matrix4::from_diagonal(&weight),
        }
    }

    /// The same with one more crossing; unchanged by one that tells nothing of its own.
    pub fn add(&mut self, crossing: AxisCrossing) {
        let Some((row, rest, whitened)) = self.bordered(&crossing) else {
            return;
        };
        let n = self.crossings.len();
        let mut factor = DMatrix::zeros(n + 1, n + 1);
        factor.view_mut((0, 0), (n, n)).copy_from(&self.factor);
        factor.view_mut((n, 0), (1, n)).copy_from(&row.transpose());
        factor[(n, n)] = rest;
        self.factor = factor;
        self.crossings.push(crossing);
        self.information += whitened * whitened.transpose();
        self.whitened.push(whitened);
    }

    /// How well all that is asked is known.
    pub fn precision(&self) -> Precision {
        self.precision_of(&self.information)
    }

    /// The same after one more crossing.
    pub fn precision_after(&self, crossing: &AxisCrossing) -> Precision {
        match self.bordered(crossing) {
            Some((_, _, g)) => self.precision_of(&(self.information + g * g.transpose())),
            None => self.precision(),
        }
    }

    /// The new row of L with its diagonal, and that of L⁻¹ G.
    fn bordered(&self, crossing: &AxisCrossing) -> Option<(DVector<f64>, f64, Vector4<f64>)> {
        let shared = self.crossings.iter();
        let shared = shared.map(|other| self.eddy_covariance(crossing, other));
        let shared = DVector::from_vec(shared.collect());
        let row = if shared.is_empty() {
            shared
        } else {
            self.factor.solve_lower_triangular(&shared)?
        };
        let zeta = self.zeta(crossing);
        // Off the axis the sensor's noise is a larger part of what is read.
        let noise = (self.plume.noise)(crossing.distance_m) * (0.5 * zeta * zeta).exp();
        let own = self.eddy_covariance(crossing, crossing) + FLUCTUATION.powi(2) + noise.powi(2);
        let rest = (own - row.norm_squared()).sqrt();
        let mut whitened = self.gradient(crossing);
        for (weight, other) in row.iter().zip(&self.whitened) {
            whitened -= *weight * other;
        }
        let whitened = whitened / rest;
        (rest > 0.0 && whitened.iter().all(|v| v.is_finite())).then_some((row, rest, whitened))
    }

    /// Spread of the plume in one crossing, m.
    fn instantaneous_m(&self, distance_m: f64) -> f64 {
        (self.plume.sigma_z_m)(distance_m) * (1.0 - MEANDER_SHARE).sqrt()
    }

    /// Height above the axis over the spread of the plume in one crossing.
    fn zeta(&self, crossing: &AxisCrossing) -> f64 {
        let above_m = crossing.height_amsl_m - self.plume.height_amsl_m;
        above_m / self.instantaneous_m(crossing.distance_m)
    }

    fn gradient(&self, crossing: &AxisCrossing) -> Vector4<f64> {
        let sigma_z_m = (self.plume.sigma_z_m)(crossing.distance_m);
        let zeta = (crossing.height_amsl_m - self.plume.height_amsl_m) / sigma_z_m;
        Vector4::new(
            1.0,
            zeta / sigma_z_m,
            zeta * zeta,
            (self.plume.c_max_distance_m / crossing.distance_m).ln(),
        )
    }

    /// Relative covariance of what two crossings read, by the eddies.
    fn eddy_covariance(&self, a: &AxisCrossing, b: &AxisCrossing) -> f64 {
        // Of the displacement over the plume's spread in one crossing.
        let variance = MEANDER_SHARE / (1.0 - MEANDER_SHARE);
        let covariance = variance * self.same_eddies(a, b);
        let (zeta_a, zeta_b) = (self.zeta(a), self.zeta(b));
        let own = 1.0 + variance;
        let determinant = own * own - covariance * covariance;
        let (squares, product) = (zeta_a * zeta_a + zeta_b * zeta_b, zeta_a * zeta_b);
        let both = (own * squares - 2.0 * covariance * product) / determinant;
        // ln of E[A_a A_b] over E[A_a] E[A_b].
        let ln_ratio = -0.5 * (determinant / (own * own)).ln() - 0.5 * (both - squares / own);
        ln_ratio.exp_m1()
    }

    /// Correlation of the displacements in two crossings.
    fn same_eddies(&self, a: &AxisCrossing, b: &AxisCrossing) -> f64 {
        let travel_s = |c: &AxisCrossing| c.distance_m / self.plume.wind_m_s;
        let (travel_a, travel_b) = (travel_s(a), travel_s(b));
        let first = (a.time_s - travel_a).max(b.time_s - travel_b);
        let shared_s = (a.time_s.min(b.time_s) - first).max(0.0);
        shared_s / (travel_a * travel_b).sqrt()
    }

    fn precision_of(&self, information: &Matrix4<f64>) -> Precision {
        let covariance = information.try_inverse().unwrap_or_else(Matrix4::zeros);
        let sd = |of: Vector4<f64>| of.dot(&(covariance * of)).max(0.0).sqrt();
        let nearer = (self.plume.c_max_distance_m / self.plume.peak_distance_m).ln();
        Precision {
            peak: sd(Vector4::new(1.0, 0.0, 0.0, nearer)),
            flux: sd(Vector4::new(1.0, 0.0, 1.0, nearer)),
            c_max: sd(Vector4::new(1.0, 0.0, 0.0, 0.0)),
            height_m: sd(Vector4::new(0.0, 1.0, 0.0, 0.0)),
            sigma_z: sd(Vector4::new(0.0, 0.0, 1.0, 0.0)),
        }
    }
}
