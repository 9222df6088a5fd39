//! Delay line: captured values that become readable after a latency.

use crate::schedule::Phases;

/// Values that are delivered a fixed number of physics steps after their capture, in one queue per environment. All
/// memory is allocated at construction.
#[derive(Clone, Debug)]
pub(crate) struct DelayLine<T> {
    steps: u64,
    /// Slots per environment.
    capacity: usize,
    queues: Vec<Queue>,
    /// Values with the physics steps of their capture, environment by environment.
    slots: Vec<(u64, T)>,
    /// Physics step of the last refresh of each environment.
    last_refresh: Vec<u64>,
}

/// A ring buffer in the slots of one environment.
#[derive(Clone, Copy, Debug, Default)]
struct Queue {
    first: usize,
    len: usize,
}

/// Returns the maximum number of values of an environment that are in flight. If a value is captured every `period`
/// steps, these are the values of the last `steps` steps and the newest one.
pub(crate) fn capacity(steps: u64, period: u64) -> usize {
    usize::try_from(steps.div_ceil(period)).map_or(usize::MAX, |n| n.saturating_add(1))
}

impl<T: Clone> DelayLine<T> {
    /// Creates queues of values that are captured at most every `period` physics steps and delivered `steps` physics
    /// steps later; slots start with `value`.
    pub(crate) fn new(num_envs: usize, steps: u64, period: u64, value: T) -> Self {
        let capacity = capacity(steps, period);
        let slots = vec![(0, value); num_envs * capacity];
        Self { steps, capacity, queues: vec![Queue::default(); num_envs], slots, last_refresh: vec![0; num_envs] }
    }

    /// Puts a value of environment `env` in flight at `step`. The returned slot holds an old value, to be overwritten.
    /// A full queue drops its oldest value.
    pub(crate) fn push(&mut self, env: usize, step: u64) -> &mut T {
        let queue = &mut self.queues[env];
        if queue.len == self.capacity {
            // No value was taken for a long time: the oldest value would have been overtaken anyway.
            *queue = Queue { first: (queue.first + 1) % self.capacity, len: queue.len - 1 };
        }
        let slot = env * self.capacity + (queue.first + queue.len) % self.capacity;
        queue.len += 1;
        let (captured, value) = &mut self.slots[slot];
        *captured = step;
        value
    }

    /// Takes the oldest value of environment `env` that is due for delivery by `step`, with true if it was captured
    /// after the last [`refresh`](Self::refresh); `None` if no value is due.
    pub(crate) fn take(&mut self, env: usize, step: u64) -> Option<(&T, bool)> {
        self.next_delivery(env).filter(|&arrival| arrival <= step)?;
        let queue = &mut self.queues[env];
        let slot = env * self.capacity + queue.first;
        *queue = Queue { first: (queue.first + 1) % self.capacity, len: queue.len - 1 };
        let (captured, value) = &self.slots[slot];
        Some((value, *captured > self.last_refresh[env]))
    }

    /// Returns the step of environment `env` at which its next value is delivered; `None` if no value is in flight.
    fn next_delivery(&self, env: usize) -> Option<u64> {
        let queue = self.queues[env];
        (queue.len > 0).then(|| self.slots[env * self.capacity + queue.first].0 + self.steps)
    }

    /// Returns the number of steps until the next delivery in any environment, at least 1. `steps` are the current
    /// steps of the environments; environments at [`Phases::QUARANTINED`] are skipped. `None` if no other environment
    /// has a value in flight.
    pub(crate) fn due_in(&self, steps: impl IntoIterator<Item = u64>) -> Option<u64> {
        let running = steps.into_iter().enumerate().filter(|(_, now)| *now != Phases::QUARANTINED);
        running.filter_map(|(env, now)| Some(self.next_delivery(env)?.saturating_sub(now).max(1))).min()
    }

    /// Records that the current value of environment `env` was refreshed at `step`. Values that were captured before do
    /// not replace it when they are delivered.
    pub(crate) fn refresh(&mut self, env: usize, step: u64) {
        self.last_refresh[env] = step;
    }

    /// Drops the values of environment `env` that are in flight.
    pub(crate) fn clear(&mut self, env: usize) {
        self.queues[env] = Queue::default();
    }
}
