//! What vehicles do and read, for ROS 2 (`--ros2`).

use crate::{Failure, listener, ranges, runtime};
use mission::Setup;
use net::ros2::{DEFAULT_ENDPOINT, Node};
use protocol::bus::Publication;
use record::export::ros2::Converter;
use tokio::runtime::Runtime;

/// How altitudes of NavSatFix are found.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct Undulation {
    /// Height of the geoid above the WGS84 ellipsoid for ROS 2, -110 to 90 m; without it, NavSatFix messages have no
    /// altitude
    #[arg(
        long,
        value_name = "M",
        value_parser = ranges::real(ranges::UNDULATIONS_M, " m"),
        allow_hyphen_values = true
    )]
    undulation_m: Option<f64>,
}

impl Undulation {
    /// The height, m, if it was given.
    pub fn m(self) -> Option<f64> {
        self.undulation_m
    }
}

/// Arguments of programs that publish to ROS 2.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Integrations")]
pub struct Ros2Arguments {
    /// Publish vehicle states and readings to ROS 2 by the rmw_zenoh router at ENDPOINT (tcp/127.0.0.1:7447 if only
    /// --ros2 is given)
    #[arg(
        long,
        value_name = "ENDPOINT",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = DEFAULT_ENDPOINT
    )]
    ros2: Option<String>,
    /// ROS 2 domain, a whole number from 0 [default: ROS_DOMAIN_ID, else 0]
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
                    "ROS_DOMAIN_ID={text}: expected a whole number; --ros2-domain overrides it"
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
    /// An invalid endpoint.
    pub fn open(arguments: &Ros2Arguments, setup: &Setup) -> Result<Option<Self>, Failure> {
        let undulation_m = arguments.undulation.m();
        let Some(endpoint) = &arguments.ros2 else {
            return Ok(None);
        };
        let domain = arguments.domain()?;
        let runtime = runtime::start("ros2", 2)?;
        let node = runtime
            .block_on(Node::open("plumage", domain, endpoint))
            .map_err(Failure::input)?;
        eprintln!("ROS 2: node /plumage on domain {domain} by {endpoint}");
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
                self.node.say(net::ros2::RosMessage {
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
                "warning: {lost} messages were not published to ROS 2: the router accepts them too slowly"
            );
        }
        self.runtime.block_on(self.node.close());
    }
}
