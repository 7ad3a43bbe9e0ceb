//! Errors of this crate.

/// Error of this crate.
#[derive(Debug, thiserror::Error)]
pub enum BridgeError {
    /// Invalid address of a link.
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
        /// The expected form.
        expected: &'static str,
    },
    /// A socket refused.
    #[error("link {link}: {source}")]
    Socket {
        /// The requested link.
        link: String,
        /// The system's error.
        source: std::io::Error,
    },
}
