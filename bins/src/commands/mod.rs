//! The commands of `plumage`, one module each.

pub mod campaign;
pub mod conduct;
pub mod replay;
pub mod run;
