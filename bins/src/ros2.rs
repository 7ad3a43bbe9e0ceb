//! What vehicles do and read, for ROS 2 (`--ros2`).

use crate::{Failure, listener};
use mission::Setup;
use net::ros2::{DEFAULT_ENDPOINT, Node};
use protocol::bus::Publication;
use record::export::ros2::Converter;
use tokio::runtime::Runtime;

/// Largest and smallest height of the geoid above the ellipsoid on Earth, m (EGM2008: -107 to 86).
const UNDULATIONS_M: std::ops::RangeInclusive<f64> = -110.0..=90.0;

/// How altitudes of NavSatFix are found.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct Undulation {
    /// For ROS 2: the geoid's height above the ellipsoid, m; altitudes of NavSatFix are left out without
    #[arg(long, value_name = "M", allow_hyphen_values = true)]
    undulation_m: Option<f64>,
}

impl Undulation {
    /// The height, m, if it was given.
    ///
    /// # Errors
    /// One that is not found on Earth.
    pub fn m(self) -> Result<Option<f64>, Failure> {
        match self.undulation_m {
            Some(m) if !UNDULATIONS_M.contains(&m) => Err(Failure::usage(format!(
                "--undulation-m {m}: expected -110 to 90 m, such as 55 for north-west Spain"
            ))),
            given => Ok(given),
        }
    }
}

/// Arguments of programs that publish to ROS 2.
#[derive(Debug, clap::Args)]
pub struct Ros2Arguments {
    /// Publish what vehicles do and read to ROS 2 on rmw_zenoh, whose router is there (tcp/127.0.0.1:7447 without
    /// an endpoint)
    #[arg(long, value_name = "ENDPOINT", num_args = 0..=1, require_equals = true, default_missing_value = DEFAULT_ENDPOINT)]
    ros2: Option<String>,
    /// Domain of ROS 2; that in ROS_DOMAIN_ID, or 0, if not given
    #[arg(long, value_name = "N", requires = "ros2")]
    ros2_domain: Option<u32>,
    #[command(flatten)]
    undulation: Undulation,
}

impl Ros2Arguments {
    fn domain(&self) -> Result<u32, Failure> {
        if let Some(domain) = self.ros2_domain {
            return Ok(domain);
        }
        match std::env::var("ROS_DOMAIN_ID") {
            Ok(text) if !text.is_empty() => text.parse().map_err(|_| {
                Failure::usage(format!(
                    "ROS_DOMAIN_ID is '{text}': expected a number, or --ros2-domain"
                ))
            }),
            _ => Ok(0),
        }
    }
}

/// A node of ROS 2 that tells of a mission.
pub struct Ros2 {
    runtime: Runtime,
    node: Node,
    converter: Converter,
    /// When the mission began, ns since 1970, once that is known.
    start_unix_ns: Option<i64>,
}

impl Ros2 {
    /// Opens the node, if that was asked for.
    ///
    /// # Errors
    /// An endpoint that is none.
    pub fn open(arguments: &Ros2Arguments, setup: &Setup) -> Result<Option<Self>, Failure> {
        let undulation_m = arguments.undulation.m()?;
        let Some(endpoint) = &arguments.ros2 else {
            return Ok(None);
        };
        let domain = arguments.domain()?;
        // Zenoh needs several threads; both wait for the network only.
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()?;
        let node = runtime
            .block_on(Node::open("plumage", domain, endpoint))
            .map_err(Failure::input)?;
        eprintln!("ROS 2: node /plumage on domain {domain}, by {endpoint}");
        Ok(Some(Self {
            runtime,
            node,
            converter: Converter {
                gas: setup.scenario.gas(),
                frame: setup.frame()?,
                undulation_m,
            },
            start_unix_ns: setup.scenario.mission.start_unix_ns(),
        }))
    }

    /// Takes in what was said on the bus.
    pub fn take(&mut self, said: &[Publication]) {
        for (topic, envelope) in said {
            let start = *self
                .start_unix_ns
                .get_or_insert_with(|| listener::begun(envelope));
            for said in self.converter.take(topic, envelope, start) {
                self.node.say(net::ros2::Said {
                    topic: said.topic,
                    type_name: said.kind.name().to_owned(),
                    type_hash: said.kind.hash().to_owned(),
                    at_unix_ns: said.at_unix_ns,
                    cdr: said.cdr,
                });
            }
        }
    }

    /// Leaves, and tells what was lost.
    pub fn close(self) {
        let lost = self.node.lost();
        if lost > 0 {
            eprintln!(
                "warning: {lost} messages were not published to ROS 2, which takes them in more slowly"
            );
        }
        self.runtime.block_on(self.node.close());
    }
}
