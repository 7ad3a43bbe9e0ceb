//! Bytes over UDP and TCP.
