//! The places that may be flown to.

use std::fmt;
use std::sync::Arc;

use rand::RngExt;
use rand::rngs::ChaCha8Rng;

use crate::error::CseaError;
use air::geo::{Enu, Position};

/// Random places tried before a domain is called empty.
const TRIES: usize = 4096;

/// A box, and inside it whatever a predicate allows.
#[derive(Clone)]
pub struct Domain {
    low: [f64; 3],
    high: [f64; 3],
    allowed: Arc<dyn Fn(Position) -> bool + Send + Sync>,
    /// A feasible place, so that a repair of last resort always exists.
    fallback: Position,
}

impl fmt::Debug for Domain {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Domain")
            .field("low", &self.low)
            .field("high", &self.high)
            .finish_non_exhaustive()
    }
}

impl Domain {
    /// The places of the box `low`…`high` (corners, inclusive) that `allowed` accepts.
    ///
    /// # Errors
    /// A corner that is not finite, `low` above `high` on an axis, or no allowed place among
    /// the box's centre and 4096 places drawn from `rng`.
    pub fn new(
        low: Position,
        high: Position,
        allowed: impl Fn(Position) -> bool + Send + Sync + 'static,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, CseaError> {
        if !low.is_finite() || !high.is_finite() {
            return Err(CseaError::Domain(
                "a corner is not finite; expected finite metres".into(),
            ));
        }
        let (low, high) = (low.coordinates(), high.coordinates());
        if (0..3).any(|axis| low[axis] > high[axis]) {
            return Err(CseaError::Domain(format!(
                "low corner {low:?} is above high corner {high:?}; expected low <= high on each axis"
            )));
        }
        let centre = Position::from_coordinates([0, 1, 2].map(|i| 0.5 * (low[i] + high[i])));
        let mut domain = Self {
            low,
            high,
            allowed: Arc::new(allowed),
            fallback: centre,
        };
        let mut tries = 0;
        while !(domain.allowed)(domain.fallback) {
            if tries == TRIES {
                return Err(CseaError::Domain(format!(
                    "none of {TRIES} points drawn from the box {low:?} to {high:?} is allowed"
                )));
            }
            tries += 1;
            domain.fallback = domain.draw_from_box(rng);
        }
        Ok(domain)
    }

    /// The box without further constraint.
    ///
    /// # Errors
    /// As [`Domain::new`].
    pub fn of_box(low: Position, high: Position) -> Result<Self, CseaError> {
        // The centre of a box is always allowed, so the generator is never asked.
        let mut unused = <ChaCha8Rng as rand::SeedableRng>::seed_from_u64(0);
        Self::new(low, high, |_| true, &mut unused)
    }

    /// Whether `position` is inside the box and allowed.
    pub fn contains(&self, position: Position) -> bool {
        let c = position.coordinates();
        (0..3).all(|axis| (self.low[axis]..=self.high[axis]).contains(&c[axis]))
            && (self.allowed)(position)
    }

    /// The corner of least east, north and height.
    pub fn low(&self) -> Position {
        Position::from_coordinates(self.low)
    }

    /// The corner of greatest east, north and height.
    pub fn high(&self) -> Position {
        Position::from_coordinates(self.high)
    }

    /// How far the farthest corner of the box is from a place, m.
    pub fn reach_m(&self, from: Enu) -> f64 {
        let [east_m, north_m] = [(0, from.east_m), (1, from.north_m)]
            .map(|(axis, c)| (self.low[axis] - c).abs().max((self.high[axis] - c).abs()));
        east_m.hypot(north_m)
    }

    /// A place that is allowed.
    pub fn inside(&self) -> Position {
        self.fallback
    }

    /// A place drawn evenly from the feasible part of the box.
    pub fn draw(&self, rng: &mut ChaCha8Rng) -> Position {
        for _ in 0..TRIES {
            let drawn = self.draw_from_box(rng);
            if (self.allowed)(drawn) {
                return drawn;
            }
        }
        self.fallback
    }

    /// Brings `wanted` into the domain: what lies outside the box is reflected at its faces;
    /// what is then not allowed is halved towards the feasible `from` a few times, and as a
    /// last resort becomes a place drawn at random.
    pub fn repair(&self, wanted: Position, from: Position, rng: &mut ChaCha8Rng) -> Position {
        let mut c = wanted.coordinates();
        for (axis, value) in c.iter_mut().enumerate() {
            // Reflected rather than clamped: clamping would pile the population up on the faces.
            *value = reflect(*value, self.low[axis], self.high[axis]);
        }
        let start = from.coordinates();
        for _ in 0..6 {
            let candidate = Position::from_coordinates(c);
            if (self.allowed)(candidate) {
                return candidate;
            }
            for axis in 0..3 {
                c[axis] = 0.5 * (c[axis] + start[axis]);
            }
        }
        self.draw(rng)
    }

    fn draw_from_box(&self, rng: &mut ChaCha8Rng) -> Position {
        let mut c = [0.0; 3];
        for (axis, value) in c.iter_mut().enumerate() {
            let part: f64 = rng.random();
            *value = self.low[axis] + part * (self.high[axis] - self.low[axis]);
        }
        Position::from_coordinates(c)
    }
}

/// `value` folded back into `[low, high]` as by mirrors at both ends.
fn reflect(value: f64, low: f64, high: f64) -> f64 {
    let width = high - low;
    if width <= 0.0 || !value.is_finite() {
        return low;
    }
    let folded = (value - low).rem_euclid(2.0 * width);
    let inside = if folded > width {
        2.0 * width - folded
    } else {
        folded
    };
    (low + inside).clamp(low, high)
}
