//! What this crate refuses.

/// Why there can be no squadron controller for a scenario.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ScError {
    /// The scenario describes no world.
    #[error(transparent)]
    World(#[from] scenario::world::WorldError),
    /// A name cannot stand in a key.
    #[error(transparent)]
    Name(#[from] protocol::ProtocolError),
    /// The search cannot be set up.
    #[error(transparent)]
    Search(#[from] csea::CseaError),
    /// The fence leaves nowhere to fly.
    #[error(
        "fence: no place inside is {margin_m:.0} m from the fence and outside the keep-out of {keep_out_m:.0} m \
         around each stack; expected a larger fence or a smaller keep-out"
    )]
    NoAirspace {
        /// Margin for turns, m.
        margin_m: f64,
        /// Keep-out radius, m.
        keep_out_m: f64,
    },
}
