//! The commands of `plumage`, one module each.

pub mod calibrate;
pub mod campaign;
pub mod conduct;
pub mod control;
pub mod doctor;
pub mod export;
pub mod fdm_server;
pub mod feed;
pub mod flux;
pub mod foxglove;
pub mod gap;
pub mod import;
pub mod keys;
pub mod plan;
pub mod replay;
pub mod run;
pub mod shell;
pub mod swap;
pub mod tune;
pub mod watch;
