"""Real-time puppetry: a person moves before a camera, and a puppet of any shape moves with them.

The way of a frame::

    source ──SkeletonFrame──▶ condition ──▶ mapping ──Intent──▶ solver ──Pose──▶ finishers
                                                                                  └─▶ viewer
"""

__version__ = "0.1.0"
