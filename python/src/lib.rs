//! Plumage for Python: the simulator's own crates behind NumPy arrays and plain objects. What is nicer to write in
//! Python is in the folder `plumage`.

mod campaign;
mod convert;
mod error;
mod flight;
mod gap;
mod gym;
mod leading;
mod mission;
mod node;
mod plume_field;
mod scenario;

/// The compiled part of the package `plumage`.
#[pyo3::pymodule]
mod _plumage {
    #[pymodule_export]
    use crate::campaign::{Campaign, Kept, merged_tables};
    #[pymodule_export]
    use crate::error::{InputError, RunError};
    #[pymodule_export]
    use crate::flight::{Aircraft, Flight};
    #[pymodule_export]
    use crate::gap::{calibrate, flux, gap_flight, gap_plume, gap_tracer, plan};
    #[pymodule_export]
    use crate::gym::Searches;
    #[pymodule_export]
    use crate::mission::{Flown, read_recording, run};
    #[pymodule_export]
    use crate::node::{Speaker, decode, key};
    #[pymodule_export]
    use crate::plume_field::Plume;
    #[pymodule_export]
    use crate::scenario::Scenario;

    /// Version of Plumage.
    #[pymodule_export]
    const VERSION: &str = env!("CARGO_PKG_VERSION");
}
