//! HTML of robots for notebooks.

use kinetoscope::robot::description::RobotDescription;
use kinetoscope::sim::Robot;
use quick_xml::escape::escape;
use std::fmt::Write as _;

/// Table of the joints and tree of the links. All names are escaped.
pub(crate) fn robot(robot: &Robot<'_>) -> String {
    let mut html = String::new();
    let (limits, stiffness, damping) = (robot.qpos_limits(), robot.stiffness(), robot.damping());
    let _ = write!(
        html,
        "<b>{}</b>: {} joints, {} links, {:.3} kg<table><tr><th>id</th><th>joint</th><th>limits</th><th>stiffness</th>\
         <th>damping</th></tr>",
        escape(robot.uid()),
        robot.dof(),
        robot.link_names().len(),
        robot.total_mass()
    );
    for (id, name) in robot.joint_names().iter().enumerate() {
        let _ = write!(
            html,
            "<tr><td>{id}</td><td>{}</td><td>{:.3} to {:.3}</td><td>{}</td><td>{}</td></tr>",
            escape(name),
            limits[(0, id, 0)],
            limits[(0, id, 1)],
            stiffness[(0, id)],
            damping[(0, id)]
        );
    }
    html.push_str("</table><pre>");
    tree(robot.description(), &mut html);
    html.push_str("</pre>");
    html
}

/// Writes the links as an indented tree, with the joint that each link hangs on.
fn tree(description: &RobotDescription, html: &mut String) {
    let parents: Vec<Option<usize>> = (0..description.links.len())
        .map(|link| description.joints.iter().position(|joint| joint.child.0 == link))
        .collect();
    // A stack instead of recursion: a chain of links may be long.
    let mut open: Vec<(usize, usize)> =
        (0..parents.len()).rev().filter(|&link| parents[link].is_none()).map(|link| (link, 0)).collect();
    while let Some((link, depth)) = open.pop() {
        let joint = parents[link].map(|joint| format!(" ({})", escape(&description.joints[joint].name)));
        let name = escape(&description.links[link].name);
        let _ = writeln!(html, "{}{name}{}", "  ".repeat(depth.min(40)), joint.unwrap_or_default());
        let children = description.joints.iter().filter(|joint| joint.parent.0 == link).map(|joint| joint.child.0);
        let mut children: Vec<usize> = children.collect();
        children.reverse();
        open.extend(children.into_iter().map(|child| (child, depth + 1)));
    }
}
