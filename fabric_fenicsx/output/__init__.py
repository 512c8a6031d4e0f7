"""What a run leaves behind: ParaView time series and pictures, from plain arrays on one rank."""
