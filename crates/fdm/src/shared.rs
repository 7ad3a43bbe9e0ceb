//! One copy in memory of each aircraft type. A thousand vehicles of one type then read the same coefficients, which stay in
//! a processor's cache, instead of two copies each.

use crate::aircraft::Aircraft;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// The types that some vehicle flies.
static FLOWN: Mutex<Vec<Weak<Aircraft>>> = Mutex::new(Vec::new());

/// Returns the one copy of an aircraft that is equal to `aircraft`.
pub(crate) fn shared(aircraft: &Aircraft) -> Arc<Aircraft> {
    // Each change of the list is complete before anything may panic.
    let mut flown = FLOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let equal = |known: &Weak<Aircraft>| known.upgrade().filter(|known| **known == *aircraft);
    if let Some(known) = flown.iter().find_map(equal) {
        return known;
    }
    flown.retain(|known| known.strong_count() > 0);
    let new = Arc::new(aircraft.clone());
    flown.push(Arc::downgrade(&new));
    new
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_aircraft_are_one_and_different_ones_are_not() {
        let text = include_str!("../../../aircraft/x8.toml");
        let x8 = Aircraft::from_toml("x8.toml", text).unwrap();
        let mut heavier = x8.clone();
        heavier.body.mass_kg += 0.5;
        let (a, b, c) = (shared(&x8), shared(&x8.clone()), shared(&heavier));
        assert!(Arc::ptr_eq(&a, &b) && !Arc::ptr_eq(&a, &c));
        assert_eq!((&*a, &*c), (&x8, &heavier));
    }
}
