//! Atmospheric stability: Pasquill's classes, from the scatter of the wind's direction or from the Obukhov length.

/// Pasquill stability class, from very unstable (A) to moderately stable (F).
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize,
)]
pub enum Stability {
    /// Very unstable.
    A,
    /// Unstable.
    B,
    /// Slightly unstable.
    C,
    /// Neutral.
    D,
    /// Slightly stable.
    E,
    /// Stable.
    F,
}

impl Stability {
    /// All classes in order.
    pub const ALL: [Stability; 6] = [
        Stability::A,
        Stability::B,
        Stability::C,
        Stability::D,
        Stability::E,
        Stability::F,
    ];

    /// Position in [`Stability::ALL`], 0 for A to 5 for F.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// The class of a letter "A" to "F", either case.
    pub fn from_letter(letter: &str) -> Option<Self> {
        let position = "ABCDEF".find(letter.trim().to_ascii_uppercase().as_str())?;
        (letter.trim().len() == 1).then(|| Self::ALL[position])
    }

    /// Standard deviation of the wind's direction over a quarter of an hour, degrees: the middle of the
    /// class (US EPA 2000, EPA-454/R-99-005, table 6-8a).
    pub const fn sigma_theta_deg(self) -> f64 {
        [25.0, 20.0, 15.0, 10.0, 5.0, 2.5][self.index()]
    }

    /// The class of a standard deviation of the wind's direction over a quarter of an hour, degrees (US EPA 2000,
    /// EPA-454/R-99-005, table 6-8a, without its corrections by wind speed, which differ between day and night).
    pub fn from_sigma_theta(sigma_theta_deg: f64) -> Self {
        const LOWER_DEG: [f64; 5] = [22.5, 17.5, 12.5, 7.5, 3.8];
        let class = LOWER_DEG.iter().position(|low| sigma_theta_deg >= *low);
        Self::ALL[class.unwrap_or(5)]
    }

    /// Its letter.
    pub fn letter(self) -> char {
        ['A', 'B', 'C', 'D', 'E', 'F'][self.index()]
    }

    /// The class of an Obukhov length and a roughness length after Golder (1972), figure 5,
    /// in the straight-line form 1/L = a + b log10(z0) of Seinfeld & Pandis (2006, table 16.4),
    /// with the borders half-way between neighbouring lines. Holds for `roughness_m` of
    /// 0.001 to 0.5 m (values outside are brought to the nearer end); a length of infinite or
    /// zero size is neutral. The plot has much scatter: one class either way is usual.
    pub fn from_obukhov(obukhov_length_m: f64, roughness_m: f64) -> Self {
        if !obukhov_length_m.is_finite() || obukhov_length_m == 0.0 {
            return Stability::D;
        }
        let inverse = 1.0 / obukhov_length_m;
        let limits = Self::limits_per_m(roughness_m);
        Self::ALL[limits.partition_point(|limit| *limit <= inverse)]
    }

    /// The inverse Obukhov lengths, 1/m, between A and B, B and C and so on to E and F of [`Stability::from_obukhov`].
    pub fn limits_per_m(roughness_m: f64) -> [f64; 5] {
        // (a, b) for A to F; D is the neutral line 1/L = 0.
        const LINES: [(f64, f64); 6] = [
            (-0.096, 0.029),
            (-0.037, 0.029),
            (-0.002, 0.018),
            (0.0, 0.0),
            (0.004, -0.018),
            (0.035, -0.036),
        ];
        let log_z0 = roughness_m.clamp(0.001, 0.5).log10();
        let line = |i: usize| LINES[i].0 + LINES[i].1 * log_z0;
        std::array::from_fn(|i| 0.5 * (line(i) + line(i + 1)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // The table's middles are of their classes, its limits of the upper one.
    #[test]
    fn classes_by_the_scatter_of_the_direction() {
        for class in Stability::ALL {
            assert_eq!(Stability::from_sigma_theta(class.sigma_theta_deg()), class);
        }
        assert_eq!(Stability::from_sigma_theta(22.5), Stability::A);
        assert_eq!(Stability::from_sigma_theta(7.4), Stability::E);
    }

    // Golder (1972), figure 5, read at z0 = 0.1 m: A for L of about -8 m, D beyond 100 m, F for
    // about +14 m.
    #[test]
    fn golder_at_a_tenth_of_a_metre() {
        for (length, class) in [
            (-8.0, 'A'),
            (-15.0, 'B'),
            (-50.0, 'C'),
            (-1000.0, 'D'),
            (f64::INFINITY, 'D'),
            (1000.0, 'D'),
            (45.0, 'E'),
            (14.0, 'F'),
        ] {
            assert_eq!(
                Stability::from_obukhov(length, 0.1).letter(),
                class,
                "{length}"
            );
        }
    }

    proptest::proptest! {
        #[test]
        fn more_stable_with_growing_inverse_length(a in -0.3f64..0.3, b in -0.3f64..0.3,
                                                   z0 in 0.001f64..0.5) {
            let (low, high) = if a < b { (a, b) } else { (b, a) };
            proptest::prop_assert!(
                Stability::from_obukhov(1.0 / low, z0) <= Stability::from_obukhov(1.0 / high, z0));
        }
    }

    #[test]
    fn letters() {
        for class in Stability::ALL {
            assert_eq!(
                Stability::from_letter(&class.letter().to_string()),
                Some(class)
            );
        }
        assert_eq!(Stability::from_letter("d"), Some(Stability::D));
        for bad in ["", "G", "AB", "4"] {
            assert_eq!(Stability::from_letter(bad), None);
        }
    }
}
