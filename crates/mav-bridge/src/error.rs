//! What this crate refuses.

/// What this crate refuses.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// A link as nobody writes it.
    #[error(
        "link '{0}': expected udpin:HOST:PORT (listen), udpout:HOST:PORT or tcp:HOST:PORT (connect), tcpin:HOST:PORT (wait for a client), serial:PATH:BAUD"
    )]
    BadLink(String),
    /// A number in the configuration that cannot work.
    #[error("{what} is {value}; expected {expected}")]
    OutOfRange {
        /// The quantity, with its unit.
        what: &'static str,
        /// The value that came in.
        value: f64,
        /// What would be right.
        expected: &'static str,
    },
    /// A socket refused.
    #[error("link {link}: {source}")]
    Socket {
        /// The link as asked for.
        link: String,
        /// What the system said.
        source: std::io::Error,
    },
}
