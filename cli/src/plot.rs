//! `kinetoscope plot`: plots recorded values over time.

use crate::command_status::{CommandStatus, Result};
use crate::field_names::{group_fields, matches_pattern};
use crate::scene_report::counted;
use kinetoscope::record::{FieldSelector, RecordedTopic, Recording};
use kinetoscope::viewer::plot::{self, Plot, Series};
use std::io::Write;
use std::path::PathBuf;

/// Plot recorded values over time as SVG or PNG; without --topic, list the topics
///
/// A topic may be given by the end of its name: joint_states stands for /env_0/arm/joint_states if it is unambiguous.
/// Each --field is plotted for each --topic, so that two topics with the same joint names are overlaid, such as targets
/// and measured positions.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// Recording, .mcap or .npz
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Topic, or the end of its name; may be repeated
    #[arg(long, value_name = "NAME")]
    topic: Vec<String>,
    /// Field of these topics, such as `position[JOINT1]`; * matches any characters; may be repeated
    #[arg(long, value_name = "NAME")]
    field: Vec<String>,
    /// Environment, if the topic name does not contain it [default: the first recorded one]
    #[arg(long)]
    env: Option<usize>,
    /// Output file; its extension selects the format
    #[arg(short, long, value_name = "FILE.svg|FILE.png")]
    out: Option<PathBuf>,
    /// Title of the plot [default: the topics]
    #[arg(long)]
    title: Option<String>,
    /// Width of the plot, in pixels
    #[arg(long, default_value_t = 960)]
    width: usize,
    /// Height of the plot, in pixels
    #[arg(long, default_value_t = 540)]
    height: usize,
}

const HELP: &str = "\
Examples:
  kinetoscope plot run.mcap                       lists the topics
  kinetoscope plot run.mcap --topic joint_states  lists the fields of a topic
  kinetoscope plot run.mcap --topic joint_states --field 'position[*]' --out plot.svg

Exit codes: 0 done; 1 done, with warnings; 2 refused.";

pub(crate) fn run(args: &Args) -> Result<CommandStatus> {
    let recording = Recording::open(&args.file)?;
    let mut warned = !recording.warnings().is_empty();
    recording.warnings().iter().for_each(|warning| eprintln!("warning: {warning}"));
    let listed = if warned { CommandStatus::Warned } else { CommandStatus::Done };
    if args.topic.is_empty() {
        if args.out.is_some() || !args.field.is_empty() {
            return Err("--topic is required with --out or --field; without these flags, all topics are listed".into());
        }
        list(&recording, &recording.topics().iter().collect::<Vec<_>>());
        return Ok(listed);
    }
    let topics: Vec<&RecordedTopic> =
        args.topic.iter().map(|name| recording.topic(name, args.env)).collect::<std::result::Result<_, _>>()?;
    if args.field.is_empty() {
        if args.out.is_some() {
            let fields: Vec<String> = topics.iter().flat_map(|topic| group_fields(&topic.fields)).collect();
            return Err(format!("--field is required with --out; fields: {}", fields.join(", ")).into());
        }
        list(&recording, &topics);
        return Ok(listed);
    }
    let Some(out) = &args.out else {
        return Err("--out is required with --field: a file name that ends in .svg or .png".into());
    };
    let mut wanted = Vec::new();
    for topic in &topics {
        for field in &args.field {
            let before = wanted.len();
            wanted.extend(
                topic
                    .fields
                    .iter()
                    .filter(|known| matches_pattern(field, known))
                    .map(|known| FieldSelector::new(&topic.name, known)),
            );
            if wanted.len() == before {
                // An unknown field is passed on: the error of the recording lists the fields.
                wanted.push(FieldSelector::new(&topic.name, field));
            }
        }
    }
    let samples = recording.time_series(&wanted)?;
    let names: Vec<&str> = topics.iter().map(|topic| topic.name.as_str()).collect();
    let stem = wanted.first().map_or("", |wanted| quantity(&wanted.field));
    let same = wanted.iter().all(|wanted| self::quantity(&wanted.field) == stem);
    let mut plot = Plot::over_time(
        args.title.clone().unwrap_or_else(|| names.join(", ")),
        if same { with_unit(stem) } else { "value".into() },
    );
    plot.size = [args.width, args.height];
    for (wanted, samples) in wanted.iter().zip(samples) {
        if samples.values.is_empty() {
            eprintln!("warning: no message of {} contains {}", wanted.topic, wanted.field);
            warned = true;
        }
        let name = if names.len() == 1 { wanted.field.clone() } else { format!("{} {}", wanted.topic, wanted.field) };
        plot.series.push(Series::new(name, samples.times.into_iter().zip(samples.values).map(|(t, x)| [t, x])));
    }
    plot::write(&plot, out)?;
    let curves = counted(plot.series.len(), "curve", "curves");
    println!("{}: {curves}, {}", out.display(), counted(count_points(&plot), "point", "points"));
    Ok(if warned { CommandStatus::Warned } else { CommandStatus::Done })
}

fn count_points(plot: &Plot) -> usize {
    plot.series.iter().map(|series| series.points.len()).sum()
}

/// Prints the topics of a recording with their fields.
fn list(recording: &Recording, topics: &[&RecordedTopic]) {
    let mut out = std::io::stdout().lock();
    // A closed pipe, as with `| head`, is not an error.
    let _ = writeln!(out, "{}", recording.path().display());
    for &RecordedTopic { name, kind, count, fields } in topics {
        let messages = if *count == 1 { "message" } else { "messages" };
        let _ = writeln!(out, "{name}   {kind}, {count} {messages}");
        for field in group_fields(fields) {
            let _ = writeln!(out, "    {field}");
        }
    }
}

/// Returns a field name without its brackets.
fn quantity(field: &str) -> &str {
    field.split('[').next().unwrap_or(field)
}

fn with_unit(stem: &str) -> String {
    let unit = match stem {
        "position" => " [rad or m]",
        "velocity" => " [rad/s or m/s]",
        "effort" => " [N m or N]",
        _ => "",
    };
    format!("{stem}{unit}")
}
