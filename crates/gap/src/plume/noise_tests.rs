use super::*;
use nalgebra::{DMatrix, DVector};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

struct Case {
    ranges: Vec<Range<usize>>,
    time_s: Vec<f64>,
    used: Vec<bool>,
    sd_ppm: Vec<f64>,
    loading: Vec<Loading>,
}

impl Case {
    fn new(n: usize) -> Self {
        let half = n / 2;
        Self {
            ranges: vec![0..half, half..n],
            time_s: (0..n).map(|i| (i % half) as f64 * 1.3).collect(),
            used: (0..n).map(|i| i % 7 != 3).collect(),
            sd_ppm: vec![f64::NAN; n],
            loading: (0..n)
                .map(|i| {
                    // One sensor shows the air at once, one with a lag.
                    let shown = if i > half { 0.7 } else { 0.0 };
                    // Half of the way in clean air, as on a track.
                    if i / 10 % 2 == 0 {
                        return Loading {
                            gust: 0.0,
                            swing: 0.0,
                            shown,
                        };
                    }
                    let s = (i as f64 * 0.4).sin();
                    Loading {
                        gust: 30.0 * s * s,
                        swing: 8.0 * (i as f64 * 0.4).cos(),
                        shown,
                    }
                })
                .collect(),
        }
    }

    fn rows(&self) -> Rows<'_> {
        Rows {
            ranges: &self.ranges,
            time_s: &self.time_s,
            used: &self.used,
            sd_ppm: &self.sd_ppm,
            loading: &self.loading,
        }
    }

    /// What a sensor shows at every row of what the air does at every row, for a loading.
    fn sensor(&self, load: impl Fn(&Loading) -> f64) -> DMatrix<f64> {
        let n = self.time_s.len();
        let mut shows = DMatrix::zeros(n, n);
        for range in &self.ranges {
            for i in range.clone() {
                let l = &self.loading[i];
                let mut taken = load(l);
                if i > range.start {
                    taken -= l.shown * load(&self.loading[i - 1]);
                    for j in range.start..i {
                        shows[(i, j)] = l.shown * shows[(i - 1, j)];
                    }
                }
                shows[(i, i)] = taken;
            }
        }
        shows
    }

    /// The covariance of the used rows, written out.
    fn covariance(&self, noise: &NoiseModel) -> (Vec<usize>, DMatrix<f64>) {
        let n = self.time_s.len();
        let kept: Vec<usize> = (0..n).filter(|i| self.used[*i]).collect();
        let p = noise.ln.map(f64::exp);
        let same =
            |i: usize, j: usize| self.ranges.iter().any(|r| r.contains(&i) && r.contains(&j));
        let process = |size: f64, scale_s: f64, fast: f64| {
            DMatrix::from_fn(n, n, |i, j| {
                let dt = (self.time_s[i] - self.time_s[j]).abs();
                let slow = size.powi(2) * (-dt / scale_s).exp();
                match (i == j, same(i, j)) {
                    (true, _) => slow + fast.powi(2),
                    (_, true) => slow,
                    _ => 0.0,
                }
            })
        };
        let (gust, swing) = (self.sensor(|l| l.gust), self.sensor(|l| l.swing));
        let all = process(p[1], p[2], p[0])
            + &gust * process(p[3], p[4], p[7]) * gust.transpose()
            + &swing * process(p[5], p[6], p[8]) * swing.transpose();
        let c = DMatrix::from_fn(kept.len(), kept.len(), |a, b| all[(kept[a], kept[b])]);
        (kept, c)
    }

    fn draw(&self, noise: &NoiseModel, seed: u64) -> Vec<f64> {
        let (kept, c) = self.covariance(noise);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let z = DVector::from_fn(kept.len(), |_, _| StandardNormal.sample(&mut rng));
        let x = c.cholesky().unwrap().l() * z;
        let mut out = vec![0.0; self.time_s.len()];
        kept.iter().zip(x.iter()).for_each(|(i, v)| out[*i] = *v);
        out
    }
}

// The filter against the dense Gaussian density, residuals small enough to have no outliers.
#[test]
fn filter_is_the_dense_gaussian() {
    let case = Case::new(80);
    let noise = NoiseModel::prior(1.2);
    let residual: Vec<f64> = case.draw(&noise, 1).iter().map(|v| 0.4 * v).collect();
    let (kept, c) = case.covariance(&noise);
    let r = DVector::from_iterator(kept.len(), kept.iter().map(|i| residual[*i]));
    let chol = c.cholesky().unwrap();
    let log_det: f64 = chol.l().diagonal().iter().map(|d| d.ln()).sum();
    let exact = -0.5 * r.dot(&chol.solve(&r)) - log_det - kept.len() as f64 * LN_ROOT_TAU;
    let filtered = log_likelihood(&case.rows(), &noise, &residual);
    assert!((exact - filtered).abs() < 1e-8, "{exact} {filtered}");
    // Whitened columns have the inner products of the inverse covariance.
    let column: Vec<f64> = (0..80).map(|i| (f64::from(i) * 0.11).cos()).collect();
    let whitener = Whitener::new(&case.rows(), &noise, &residual);
    let (mut a, mut b) = (column.clone(), residual.clone());
    whitener.whiten(&mut [&mut a, &mut b]);
    let u = DVector::from_iterator(kept.len(), kept.iter().map(|i| column[*i]));
    let exact = u.dot(&chol.solve(&r));
    assert!((crate::plume::linear::dot(&a, &b) - exact).abs() < 1e-8 * exact.abs().max(1.0));
    assert!(whitener.spikes.is_empty());
}

#[test]
fn a_spike_counts_a_few_nats_only() {
    let case = Case::new(400);
    let noise = NoiseModel::prior(1.2);
    let mut residual = case.draw(&noise, 2);
    let clean = log_likelihood(&case.rows(), &noise, &residual);
    residual[100] += 1e4;
    let whitener = Whitener::new(&case.rows(), &noise, &residual);
    assert!(clean - whitener.log_likelihood < 20.0);
    assert!(whitener.spikes.contains(&100));
}

#[test]
fn fit_finds_the_noise_that_made_the_data() {
    let case = Case::new(1200);
    let mut truth = NoiseModel::prior(1.2);
    truth.ln[WHITE] = 2.0f64.ln();
    truth.ln[GUST] = 0.25f64.ln();
    let residual = case.draw(&truth, 3);
    let rows = case.rows();
    let value = |n: &NoiseModel| log_likelihood(&rows, n, &residual) + n.ln_prior();
    let fitted = fit(&rows, &NoiseModel::prior(1.2), 25, 2, &value);
    assert!(
        (fitted.white_ppm() / 2.0 - 1.0).abs() < 0.15,
        "{}",
        fitted.white_ppm()
    );
    assert!(
        (fitted.gust().0 / 0.25 - 1.0).abs() < 0.3,
        "{}",
        fitted.gust().0
    );
    let one = fit(&rows, &NoiseModel::prior(1.2), 25, 1, &value);
    assert_eq!(one, fitted);
}

#[test]
fn whitening_back_is_the_transpose() {
    let case = Case::new(200);
    let noise = NoiseModel::prior(1.5);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut draw = || -> Vec<f64> { (0..200).map(|_| StandardNormal.sample(&mut rng)).collect() };
    let (residual, plain, other) = (draw(), draw(), draw());
    let whitener = Whitener::new(&case.rows(), &noise, &residual);
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let (mut white, mut back) = (plain.clone(), other.clone());
    whitener.whiten_one(&mut white);
    whitener.whiten_back(&mut back);
    let (forth, back) = (product(&white, &other), product(&plain, &back));
    assert!(
        (forth - back).abs() < 1e-9 * forth.abs().max(1.0),
        "{forth} {back}"
    );
}
