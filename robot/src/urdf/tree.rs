//! Tree of links and joints of a URDF file, with its checks: links must form a tree, and mimic chains must end at a
//! free joint.
//!
//! Traversals do not recurse: a chain of a million links is as safe as one of ten.

use super::error::UrdfError;
use kinetoscope_scene::pattern::closest_names;
use kinetoscope_scene::source_location::SourceLocation;
use std::collections::HashMap;

/// Tree of the links and joints of one file, as indices of links and joints in file order.
#[derive(Clone, Debug, Default)]
pub struct Tree {
    /// Link without a parent.
    pub root: usize,
    /// Parent and child link of each joint.
    pub joint_links: Vec<(usize, usize)>,
    /// Joint above each link; `None` for the root.
    pub parent_joint: Vec<Option<usize>>,
    /// Joints below each link, in file order.
    pub child_joints: Vec<Vec<usize>>,
    /// Joint that each joint mimics; `None` for a joint without a mimic.
    pub mimics: Vec<Option<usize>>,
    /// Number of joints between the root and each link, fixed joints included.
    pub depth: Vec<usize>,
}

/// Named element and its location.
#[derive(Clone, Debug)]
pub(super) struct NamedElement {
    pub(super) name: String,
    pub(super) source: SourceLocation,
}

/// Joint as an edge of the graph.
#[derive(Clone, Debug)]
pub(super) struct JointEdge {
    pub(super) joint: NamedElement,
    /// Name of the parent link, with the location of the element that names it.
    pub(super) parent: NamedElement,
    pub(super) child: NamedElement,
    /// Name of the followed joint, with the location of the element that names it; `None` without a mimic.
    pub(super) mimic: Option<NamedElement>,
    /// Name of the joint type.
    pub(super) kind: &'static str,
    /// True if other joints can follow this joint.
    pub(super) is_drivable: bool,
}

impl Tree {
    /// Builds the tree. Checks names, the tree and the mimic chains.
    pub(super) fn build(
        robot: &SourceLocation,
        links: &[NamedElement],
        edges: &[JointEdge],
    ) -> Result<Self, UrdfError> {
        if links.is_empty() {
            return Err(UrdfError::NoLinks { at: robot.clone() });
        }
        let link_ids = index("link", links.iter())?;
        let joint_ids = index("joint", edges.iter().map(|e| &e.joint))?;
        let find = |edge: &JointEdge, end: &NamedElement, role: &'static str| {
            link_ids.get(end.name.as_str()).copied().ok_or_else(|| UrdfError::LinkUnknown {
                at: end.source.clone(),
                joint: edge.joint.name.clone(),
                role,
                link: end.name.clone(),
                candidates: owned(closest_names(&end.name, links.iter().map(|l| l.name.as_str()))),
                total: links.len(),
            })
        };
        let mut tree = Self {
            parent_joint: vec![None; links.len()],
            child_joints: vec![Vec::new(); links.len()],
            ..Self::default()
        };
        for (id, edge) in edges.iter().enumerate() {
            let (parent, child) = (find(edge, &edge.parent, "parent")?, find(edge, &edge.child, "child")?);
            if let Some(first) = tree.parent_joint[child].replace(id) {
                return Err(UrdfError::MultipleParents {
                    link: edge.child.name.clone(),
                    first_joint: edges[first].joint.name.clone(),
                    first: edges[first].joint.source.clone(),
                    second_joint: edge.joint.name.clone(),
                    second: edge.joint.source.clone(),
                });
            }
            tree.child_joints[parent].push(id);
            tree.joint_links.push((parent, child));
        }
        tree.find_root(links, edges)?;
        tree.resolve_mimics(edges, &joint_ids)?;
        Ok(tree)
    }

    /// Finds the root and the depths. Every link has at most one parent here, so links that the only root does not
    /// reach contain a cycle.
    fn find_root(&mut self, links: &[NamedElement], edges: &[JointEdge]) -> Result<(), UrdfError> {
        let roots: Vec<usize> = (0..links.len()).filter(|&l| self.parent_joint[l].is_none()).collect();
        if roots.len() > 1 {
            let roots = roots.iter().map(|&l| (links[l].name.clone(), links[l].source.clone())).collect();
            return Err(UrdfError::MultipleRoots { roots });
        }
        const UNSEEN: usize = usize::MAX;
        self.depth = vec![UNSEEN; links.len()];
        let mut pending = roots.clone();
        for &root in &roots {
            self.root = root;
            self.depth[root] = 0;
        }
        while let Some(link) = pending.pop() {
            for &joint in &self.child_joints[link] {
                let child = self.joint_links[joint].1;
                self.depth[child] = self.depth[link] + 1;
                pending.push(child);
            }
        }
        let Some(lost) = (0..links.len()).find(|&l| self.depth[l] == UNSEEN) else { return Ok(()) };
        Err(self.cycle_error(lost, links, edges))
    }

    /// Describes the cycle above `lost`, a link that the root does not reach.
    fn cycle_error(&self, lost: usize, links: &[NamedElement], edges: &[JointEdge]) -> UrdfError {
        let mut seen = vec![false; links.len()];
        let mut link = lost;
        let mut joints = Vec::new();
        while let Some(joint) = self.parent_joint[link] {
            if std::mem::replace(&mut seen[link], true) {
                break;
            }
            joints.push(joint);
            link = self.joint_links[joint].0;
        }
        // The walk entered the cycle at `link`; earlier joints are a tail.
        let start = joints.iter().position(|&j| self.joint_links[j].1 == link).unwrap_or(0);
        let mut circle = joints.split_off(start);
        circle.reverse();
        let first = circle.iter().enumerate().min_by_key(|&(_, &j)| j).map_or(0, |(i, _)| i);
        circle.rotate_left(first);
        let closing = &edges[circle[0]].joint;
        UrdfError::Cycle {
            at: closing.source.clone(),
            joint: closing.name.clone(),
            links: circle.iter().map(|&j| links[self.joint_links[j].1].name.clone()).collect(),
        }
    }

    fn resolve_mimics(&mut self, edges: &[JointEdge], joint_ids: &HashMap<&str, usize>) -> Result<(), UrdfError> {
        self.mimics = vec![None; edges.len()];
        for (id, edge) in edges.iter().enumerate() {
            let Some(mimic) = &edge.mimic else { continue };
            let Some(&followed) = joint_ids.get(mimic.name.as_str()) else {
                return Err(UrdfError::MimicUnknown {
                    at: mimic.source.clone(),
                    joint: edge.joint.name.clone(),
                    mimicked_joint: mimic.name.clone(),
                    candidates: owned(closest_names(&mimic.name, edges.iter().map(|e| e.joint.name.as_str()))),
                    total: edges.len(),
                });
            };
            if !edges[followed].is_drivable {
                return Err(UrdfError::MimicNotDrivable {
                    at: mimic.source.clone(),
                    joint: edge.joint.name.clone(),
                    followed: mimic.name.clone(),
                    kind: edges[followed].kind,
                });
            }
            self.mimics[id] = Some(followed);
        }
        // Each joint is marked with the walk that first reached it: reaching a mark of the same walk is a cycle.
        let mut visited_by = vec![usize::MAX; edges.len()];
        for start in 0..edges.len() {
            let mut joint = start;
            while visited_by[joint] == usize::MAX {
                visited_by[joint] = start;
                let Some(next) = self.mimics[joint] else { break };
                if visited_by[next] == start {
                    return Err(self.mimic_cycle_error(next, edges));
                }
                joint = next;
            }
        }
        Ok(())
    }

    fn mimic_cycle_error(&self, start: usize, edges: &[JointEdge]) -> UrdfError {
        let mut joints = vec![edges[start].joint.name.clone()];
        let mut next = self.mimics[start];
        while let Some(joint) = next.filter(|&j| j != start) {
            joints.push(edges[joint].joint.name.clone());
            next = self.mimics[joint];
        }
        let at = edges[start].mimic.as_ref().map_or(&edges[start].joint.source, |m| &m.source).clone();
        UrdfError::MimicCycle { at, joint: edges[start].joint.name.clone(), joints }
    }

    /// Returns all links with the largest [`depth`](Self::depth): the leaves at the end of the longest chains of
    /// joints, in file order.
    pub fn tips(&self) -> Vec<usize> {
        let deepest = self.depth.iter().copied().max().unwrap_or(0);
        (0..self.depth.len()).filter(|&l| self.depth[l] == deepest).collect()
    }
}

fn index<'n>(
    what: &'static str,
    named: impl Iterator<Item = &'n NamedElement>,
) -> Result<HashMap<&'n str, usize>, UrdfError> {
    let mut first: HashMap<&str, (usize, &SourceLocation)> = HashMap::new();
    for (id, n) in named.enumerate() {
        if let Some((_, source)) = first.insert(&n.name, (id, &n.source)) {
            return Err(UrdfError::NameRepeated {
                what,
                name: n.name.clone(),
                first: source.clone(),
                second: n.source.clone(),
            });
        }
    }
    Ok(first.into_iter().map(|(name, (id, _))| (name, id)).collect())
}

/// Owned copies of names, for errors.
pub(super) fn owned(names: Vec<&str>) -> Vec<String> {
    names.into_iter().map(str::to_owned).collect()
}
