//! The mean rate of a source over several visits.

use crate::{Interval, Share, Term, budget};
use plume::Gas;
use statrs::function::erf::erfc;

/// Terms that are the same on all visits: the same instrument, the same model of the spread, the same source.
const SYSTEMATIC: [Term; 5] = [
    Term::WindSpeed,
    Term::SourcePosition,
    Term::Dispersion,
    Term::Height,
    Term::Sensor,
];

/// One visit.
#[derive(Debug, Clone, PartialEq)]
pub struct Visit {
    /// Its rate, kg/s.
    pub kg_s: Interval,
    /// Shares of the variance of ln rate.
    pub budget: Vec<Share>,
}

/// The mean of one source over several visits.
#[derive(Debug, Clone, PartialEq)]
pub struct SourceMean {
    /// The source.
    pub name: String,
    /// Its gas.
    pub gas: Gas,
    /// The mean.
    pub mean: SiteMean,
    /// Each visit with its name.
    pub visits: Vec<(String, Visit)>,
    /// What a reader should know.
    pub notes: Vec<String>,
}

/// The mean over visits.
#[derive(Debug, Clone, PartialEq)]
pub struct SiteMean {
    /// Mean rate, kg/s.
    pub kg_s: Interval,
    /// Shares of the variance of ln rate. What visits differ by beyond their intervals is `representativeness`.
    pub budget: Vec<Share>,
    /// Probability of visits so far apart if the source emits the same on all; none of a single visit.
    pub agreement_p: Option<f64>,
}

/// Probability of a difference of ln rate as large as that of `a` and `b`, if both estimate the same rate and err
/// independently.
pub fn agreement_p(a: Interval, b: Interval) -> Option<f64> {
    let variance = a.ln_sd().powi(2) + b.ln_sd().powi(2);
    let z = (a.value / b.value).ln().abs() / variance.sqrt();
    z.is_finite().then(|| erfc(z / std::f64::consts::SQRT_2))
}

/// Methods agree where a difference as large as theirs has this probability or more.
pub const AGREEMENT_P: f64 = 0.05;

/// The mean of ln rates of one record by several methods, weighted by their variances. Its interval is as wide as the
/// narrowest: the methods read the same eddies. None of nothing.
pub fn of_one_record(rates: &[Interval]) -> Option<Interval> {
    let weight = |rate: &Interval| rate.ln_sd().powi(-2);
    let all: f64 = rates.iter().map(weight).sum();
    let ln = rates.iter().map(|r| r.value.ln() * weight(r)).sum::<f64>() / all;
    let ln_sd = rates.iter().map(Interval::ln_sd).reduce(f64::min)?;
    Some(Interval::of_ln_normal(ln.exp(), ln_sd))
}

impl Visit {
    /// Variance of ln rate by a term.
    fn variance(&self, term: Term) -> f64 {
        let shares = self.budget.iter().filter(|s| s.term == term);
        shares.map(|s| s.share).sum::<f64>() * self.kg_s.ln_sd().powi(2)
    }

    fn systematic(&self) -> f64 {
        SYSTEMATIC.iter().map(|t| self.variance(*t)).sum()
    }

    /// What differs from visit to visit; without a budget, all.
    fn own(&self) -> f64 {
        (self.kg_s.ln_sd().powi(2) - self.systematic()).max(f64::MIN_POSITIVE)
    }
}

/// The mean of `visits` in ln rate, by their own variances and what the source varies between them (DerSimonian & Laird
/// 1986, Control. Clin. Trials 7:177). Systematic terms are common to all visits: more of them do not narrow it. None
/// without a visit.
pub fn site_mean(visits: &[Visit]) -> Option<SiteMean> {
    if visits.is_empty() {
        return None;
    }
    let n = visits.len() as f64;
    let ln = |v: &Visit| v.kg_s.value.ln();
    let fixed: Vec<f64> = visits.iter().map(|v| 1.0 / v.own()).collect();
    let all: f64 = fixed.iter().sum();
    let mean = visits
        .iter()
        .zip(&fixed)
        .map(|(v, w)| w * ln(v))
        .sum::<f64>()
        / all;
    let q: f64 = visits
        .iter()
        .zip(&fixed)
        .map(|(v, w)| w * (ln(v) - mean).powi(2))
        .sum();
    let squares: f64 = fixed.iter().map(|w| w * w).sum();
    let freedom = all - squares / all;
    let between = if freedom > 0.0 {
        ((q - (n - 1.0)) / freedom).max(0.0)
    } else {
        0.0
    };
    let weights: Vec<f64> = visits.iter().map(|v| 1.0 / (v.own() + between)).collect();
    let all: f64 = weights.iter().sum();
    let by_weight = |of: &dyn Fn(&Visit) -> f64| {
        visits
            .iter()
            .zip(&weights)
            .map(|(v, w)| w * of(v))
            .sum::<f64>()
            / all
    };
    let ln_mean = by_weight(&ln);
    let own = by_weight(&Visit::own) / n;
    let varies = (1.0 / all - own).max(0.0);
    let systematic: Vec<(Term, f64)> = SYSTEMATIC
        .iter()
        .map(|t| (*t, by_weight(&|v| v.variance(*t))))
        .collect();
    let mut terms = systematic.clone();
    terms.push((Term::Turbulence, 1.0 / all - varies));
    terms.push((Term::Representativeness, varies));
    let ln_sd = terms.iter().map(|t| t.1).sum::<f64>().sqrt();
    Some(SiteMean {
        // Of a rate that varies log-normally between visits, the mean is above the median.
        kg_s: Interval::of_ln_normal((ln_mean + 0.5 * between).exp(), ln_sd),
        budget: budget(&terms),
        agreement_p: (visits.len() > 1).then(|| chi_squared_beyond(q, n - 1.0)),
    })
}

/// Probability that a chi-squared quantity exceeds `value`.
fn chi_squared_beyond(value: f64, freedom: f64) -> f64 {
    if value <= 0.0 {
        return 1.0;
    }
    statrs::function::gamma::gamma_ur(0.5 * freedom, 0.5 * value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn visit(value: f64, ln_sd: f64, systematic: f64) -> Visit {
        Visit {
            kg_s: Interval::of_ln_normal(value, ln_sd),
            budget: vec![
                Share {
                    term: Term::Dispersion,
                    share: systematic,
                },
                Share {
                    term: Term::Turbulence,
                    share: 1.0 - systematic,
                },
            ],
        }
    }

    /// Four visits that agree, each with ln sd 0.4 of which half of the variance is common: 0.08 + 0.08/4 = 0.1.
    #[test]
    fn systematic_terms_do_not_average_out() {
        let visits = vec![visit(2.0, 0.4, 0.5); 4];
        let site = site_mean(&visits).unwrap();
        assert!((site.kg_s.value - 2.0).abs() < 1e-9);
        assert!((site.kg_s.ln_sd() - 0.1f64.sqrt()).abs() < 1e-9, "{site:?}");
        assert_eq!(site.agreement_p, Some(1.0));
        let independent = site_mean(&[visit(2.0, 0.4, 0.0), visit(2.0, 0.4, 0.0)]).unwrap();
        assert!((independent.kg_s.ln_sd() - 0.4 / 2f64.sqrt()).abs() < 1e-9);
    }

    /// Visits a factor of ten apart with 10 % each: the source varies. τ² = ((q − 1)/freedom) with q = (ln 10)²/(2·0.01).
    #[test]
    fn a_source_that_varies_has_a_wider_mean() {
        let site = site_mean(&[visit(1.0, 0.1, 0.0), visit(10.0, 0.1, 0.0)]).unwrap();
        let between = 10f64.ln().powi(2) / 2.0 - 0.01;
        let expected = (0.5 * 10f64.ln() + 0.5 * between).exp();
        assert!((site.kg_s.value / expected - 1.0).abs() < 1e-9, "{site:?}");
        assert!(site.kg_s.ln_sd() > 1.0 && site.agreement_p.unwrap() < 1e-6);
    }

    #[test]
    fn one_visit_is_itself() {
        let one = visit(3.0, 0.3, 0.4);
        let site = site_mean(std::slice::from_ref(&one)).unwrap();
        assert!((site.kg_s.high95 / one.kg_s.high95 - 1.0).abs() < 1e-9);
        assert_eq!(site.agreement_p, None);
    }
}
