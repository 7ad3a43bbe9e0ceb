//! csea
